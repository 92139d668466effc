"""HDF5: Prophesee's compound layout and the column layout of DSEC and Spinscope."""

from __future__ import annotations

from pathlib import Path

from ....isolation import without_time_limit
from ...reader import FormatReader, ReadingOptions
from ..registry import FORMATS, RecordingContent, RecordingFormat

SIGNATURE = b"\x89HDF\r\n\x1a\n"
SIGNATURE_PLACES = (0, 512, 1024, 2048)  # behind a user block; MATLAB's is 512 bytes long


def _sniff(path: Path, head: bytes) -> bool:
    return any(head.startswith(SIGNATURE, place) for place in SIGNATURE_PLACES)


def _open(path: Path, options: ReadingOptions) -> FormatReader:
    with without_time_limit():
        from .reader import Hdf5Reader  # h5py takes 0.1 s to load

    return Hdf5Reader(path, options)


def _write(path: Path, content: RecordingContent) -> None:
    from .writer import write_hdf5

    write_hdf5(path, content)


FORMATS.register(
    RecordingFormat(
        name="hdf5",
        label="HDF5",
        suffixes=(".h5", ".hdf5"),
        sniff=_sniff,
        open=_open,
        write=_write,
        isolated=True,
        keeps=frozenset({"sensor", "attributes", "triggers", "truth", "t_offset"}),
    )
)
