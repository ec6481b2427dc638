"""FSID: RAW denoisers trained on nothing but rendered scenes.

Data flows one way, and each step is a package: assets -> scene -> render -> sensor -> dataset ->
denoise -> evaluate -> cli. See docs/architecture.md.
"""

__version__ = "0.1.0"
