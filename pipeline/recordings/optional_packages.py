"""Packages for single formats, which are installed when a file of the format is to be read."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from ..errors import RecordingError
from ..isolation import without_time_limit


def optional_module(name: str, extra: str, what: str) -> ModuleType:
    """Import a module of an extra of Spinscope; raises RecordingError with the line that installs it.

    Parameters
    ----------
    name, extra : str
        Name of the module, and of the extra that its package belongs to.
    what : str
        Files that it reads, for the message.
    """
    try:
        with without_time_limit():
            return import_module(name)
    except ImportError as error:
        raise RecordingError(
            f"{what} files are read through the package {extra}, which is not installed (`pip install "
            f"spinscope[{extra}]`, in a checkout `uv sync --extra {extra}`)"
        ) from error
