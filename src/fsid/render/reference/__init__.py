"""The same scenes by an independent path tracer (Mitsuba 3): `pip install 'fsid[reference]'`."""

from fsid.render.reference.agreement import Agreement, agreement
from fsid.render.reference.renderer import ReferenceRenderer

__all__ = ["Agreement", "ReferenceRenderer", "agreement"]
