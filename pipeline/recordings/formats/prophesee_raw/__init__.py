"""Prophesee RAW: EVT2, EVT2.1 and EVT3 are read, EVT2 and EVT3 are written."""

from __future__ import annotations

from pathlib import Path

from ...reader import FormatReader, ReadingOptions
from ..prophesee_dat import is_dat
from ..registry import FORMATS, RecordingContent, RecordingFormat
from ..text import is_text


def _sniff(path: Path, head: bytes) -> bool:
    # Columns of text may have comments that begin like lines of the header.
    return head.startswith(b"% ") and not is_dat(path, head) and not is_text(path, head)


def _open(path: Path, options: ReadingOptions) -> FormatReader:
    from .reader import RawReader  # numba takes 0.3 s to load

    return RawReader(path, options)


def _write(path: Path, content: RecordingContent) -> None:
    from .writer import write_raw

    write_raw(path, content)


FORMATS.register(
    RecordingFormat(
        name="prophesee_raw",
        label="Prophesee RAW",
        suffixes=(".raw",),
        sniff=_sniff,
        open=_open,
        write=_write,
        encodings=("EVT3", "EVT2"),
        keeps=frozenset({"sensor", "attributes", "triggers"}),
    )
)
