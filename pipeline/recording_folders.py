"""Recordings of a folder, of a pattern, or named one by one."""

from __future__ import annotations

import glob
from collections.abc import Collection, Sequence
from pathlib import Path

from .dotted_shots import is_trajectory
from .errors import RecordingError
from .recordings import is_recording, readable_suffixes
from .truth_table import TRUTH_TABLE


def recordings_in(names: Sequence[Path], others: Collection[Path] = ()) -> list[Path]:
    """Recordings named by files, folders (with those below) and patterns like `day1/*.raw`; each once.

    A folder's recordings are told by their suffixes, texts by their content; `others` are no recordings, nor are tables
    and trajectories of the truth. Raises RecordingError for a folder or a pattern without one.
    """
    found: dict[Path, None] = {}
    not_these = {path.absolute() for path in others}
    for name in names:
        if name.is_dir():
            these = [
                path
                for path in sorted(name.rglob("*"))
                if is_recording(path)
                and path.absolute() not in not_these
                and path.name != TRUTH_TABLE
                and not is_trajectory(path)
            ]
            if not these:
                raise RecordingError(f"the folder holds no recordings ({', '.join(readable_suffixes())}): {name}")
        elif not name.exists() and glob.has_magic(str(name)):
            these = sorted(path for path in map(Path, glob.glob(str(name), recursive=True)) if path.is_file())
            if not these:
                raise RecordingError(f"no file fits the pattern: {name}")
        else:
            these = [name]
        found |= dict.fromkeys(these)
    return list(found)
