"""Prophesee DAT: a header of text lines, two bytes, then 64 bits an event."""

from __future__ import annotations

from pathlib import Path

from ...prophesee_header import parse_header
from ...reader import FormatReader, ReadingOptions
from ..registry import FORMATS, RecordingContent, RecordingFormat
from .header import EVENT_BYTES, EVENT_KINDS


def is_dat(path: Path, head: bytes) -> bool:
    """Whether a file starts like DAT: by its first line, or else by the two bytes behind its header."""
    if head.startswith(b"% Data file"):
        return True
    header, end = parse_header(head)
    names_encoding = "evt" in header or "format" in header  # RAW
    return (
        end > 0 and not names_encoding and head[end : end + 2] in [bytes((kind, EVENT_BYTES)) for kind in EVENT_KINDS]
    )


def _open(path: Path, options: ReadingOptions) -> FormatReader:
    from .reader import DatReader  # loads numba

    return DatReader(path, options)


def _write(path: Path, content: RecordingContent) -> None:
    from .writer import write_dat

    write_dat(path, content)


FORMATS.register(
    RecordingFormat(
        name="prophesee_dat",
        label="Prophesee DAT",
        suffixes=(".dat",),
        sniff=is_dat,
        open=_open,
        write=_write,
        keeps=frozenset({"sensor", "attributes"}),
    )
)
