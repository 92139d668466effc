"""Check for endless loops in HDF5's global heap, on which the library itself would hang.

Texts of attributes lie in "global heap collections" (HDF5 file format, III.E): a head of 16 bytes, then
objects that each start with 16 bytes, index 0 being the free space. The library steps from object to object
by their sizes; a free space of size 0 does not end.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

from ....errors import RecordingError

SIGNATURE = b"GCOL\x01\x00\x00\x00"
SEARCHED_BYTES = 8 << 20  # attributes are written before or after the columns: heaps lie near either end
HEAD_BYTES = 16


def check_heap(path: Path) -> None:
    """Raise RecordingError when the walk over a heap near the start or the end of the file would not end."""
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        for start in dict.fromkeys((0, max(0, size - SEARCHED_BYTES))):
            file.seek(start)
            data = file.read(SEARCHED_BYTES)
            if not all(terminates(data[found.start() :]) for found in re.finditer(SIGNATURE, data)):
                raise RecordingError(
                    f"HDF5 file is damaged (a heap of texts without end): copy or export it again: {path}"
                )


def terminates(heap: bytes) -> bool:
    """Whether walking over the objects of the collection that `heap` starts with comes to an end."""
    if len(heap) < HEAD_BYTES:
        return True
    total = min(int(struct.unpack_from("<Q", heap, 8)[0]), len(heap))
    at = HEAD_BYTES
    while at + HEAD_BYTES <= total:
        index, length = struct.unpack_from("<H6xQ", heap, at)
        step = length if index == 0 else HEAD_BYTES + -(-length // 8) * 8
        if step == 0:
            return False
        at += step
    return True
