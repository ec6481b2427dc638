"""Mesh families, one file per group of household objects; found by `fsid.assets.registry`."""
