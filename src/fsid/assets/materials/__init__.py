"""Material families, one file per kind of surface; found by `fsid.assets.material_registry`."""
