"""A black level between two integers, as phones state it and FSID never does."""

import struct
from pathlib import Path


def state_black(path: Path, numerator: int, denominator: int) -> None:
    """Put that rational in the place of the black level, 64, of a DNG that FSID wrote."""
    data, whole = path.read_bytes(), struct.pack("<HHII", 50714, 4, 1, 64)
    assert data.count(whole) == 1
    rational = struct.pack("<HHII", 50714, 5, 1, len(data))
    path.write_bytes(data.replace(whole, rational) + struct.pack("<II", numerator, denominator))
