"""Lists of opcodes in a DNG: what a converter is to do with pixels, in order (specification, chapter 7).

    count | number, version, flags, size, parameters | ...        always big endian

OpcodeList1 is for pixels as they are stored, OpcodeList2 for linear ones, OpcodeList3 for those after
demosaicing. LibRaw applies none of them.
"""

from __future__ import annotations

import struct

_MAX_OPCODES = 1 << 10


def opcodes(data: bytes) -> list[tuple[int, bytes]]:
    """(number, parameters) of each in a list, up to the first one that is not whole."""
    if len(data) < 4:
        return []
    found, at = [], 4
    for _ in range(min(struct.unpack(">I", data[:4])[0], _MAX_OPCODES)):
        if at + 16 > len(data):
            break
        number, _, _, size = struct.unpack_from(">4I", data, at)
        if at + 16 + size > len(data):
            break
        found.append((number, data[at + 16 : at + 16 + size]))
        at += 16 + size
    return found
