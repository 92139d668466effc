"""Formats of recordings on disk: every module or package in this folder registers one."""

from importlib import import_module
from pkgutil import iter_modules

from .registry import (
    FORMATS,
    HEAD_BYTES,
    RecordingContent,
    RecordingFormat,
    format_to_write,
    readable_suffixes,
    writable_suffixes,
)

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "FORMATS",
    "HEAD_BYTES",
    "RecordingContent",
    "RecordingFormat",
    "format_to_write",
    "readable_suffixes",
    "writable_suffixes",
]
