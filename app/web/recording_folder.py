"""Recordings that the page may open: those of a folder with its subfolders, and files dropped onto the page."""

from __future__ import annotations

import os
import shutil
from collections.abc import AsyncIterator
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import is_recording

from .schemas import FolderListing, ListedRecording

DROPPED = "dropped:"  # before the names of dropped files
# All dropped files together: two of the longest that one person is likely to drag, and room on most disks.
DROPPED_BYTES = 4_000_000_000
SPARE_BYTES = 1_000_000_000  # left on the disk


class RecordingFolder:
    """A folder with its subfolders, and a bounded temporary folder of dropped files.

    A recording's name is its path within the folder with `/`, or `dropped:` and the name of the dropped file.

    Parameters
    ----------
    root : Path
        The folder; nothing outside of it is listed or opened.
    dropped_bytes : int
        Bytes that all dropped files may have together.
    """

    def __init__(self, root: Path, dropped_bytes: int = DROPPED_BYTES) -> None:
        self.root = root
        self.dropped_bytes = dropped_bytes
        self._dropped: TemporaryDirectory[str] | None = None

    def name_of(self, path: Path) -> str:
        """Name of a recording of the folder, or of a dropped file."""
        if self._dropped is not None and path.is_relative_to(self._dropped.name):
            return DROPPED + path.name
        return path.relative_to(self.root).as_posix()

    def path(self, name: str) -> Path:
        """Path of the recording of a name; raises RecordingError where there is none."""
        if name.startswith(DROPPED) and self._dropped is not None:
            parts, folder = PurePosixPath(name.removeprefix(DROPPED)).parts, Path(self._dropped.name)
        else:
            parts, folder = PurePosixPath(name).parts, self.root
        path = folder.joinpath(*parts)
        if not parts or not _is_inside(name) or not path.is_file():
            raise RecordingError(f"there is no recording {name!r} in the opened folder: choose one of its files")
        return path

    def listing(self, subfolder: str = "") -> FolderListing:
        """Folders and recordings of a subfolder; raises RecordingError where there is none."""
        folder = self.root.joinpath(*PurePosixPath(subfolder).parts)
        if not _is_inside(subfolder) or not folder.is_dir():
            raise RecordingError(f"there is no folder {subfolder!r} in the opened folder: choose one of its folders")
        try:
            entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
        except OSError as error:
            raise RecordingError(f"the folder cannot be read ({error.strerror}): {folder}") from None
        dropped = [] if subfolder or self._dropped is None else sorted(Path(self._dropped.name).iterdir())
        return FolderListing(
            root=str(self.root),
            folder=subfolder,
            folders=[path.name for path in entries if path.is_dir()],
            recordings=[
                ListedRecording(name=self.name_of(path), size_bytes=path.stat().st_size)
                for path in [*dropped, *entries]
                if is_recording(path)
            ],
        )

    async def drop(self, name: str, content: AsyncIterator[bytes]) -> Path:
        """Keep a dropped file; raises RecordingError where it is too large.

        Whatever goes wrong, the connection too, nothing of it is left.
        """
        if self._dropped is None:
            self._dropped = TemporaryDirectory(prefix="spinscope-dropped-")
        folder = Path(self._dropped.name)
        room = self.dropped_bytes - sum(path.stat().st_size for path in folder.iterdir())
        room = min(room, shutil.disk_usage(folder).free - SPARE_BYTES)
        path = _unused(folder, PurePosixPath(name.replace("\\", "/")).name or "recording")
        try:
            with open(path, "xb") as file:
                async for chunk in content:
                    room -= len(chunk)
                    if room < 0:
                        raise RecordingError(
                            f"{name} is too large to be dropped onto the page: all dropped files together may have "
                            f"{self.dropped_bytes / 1e9:.3g} GB, and must leave room on the disk; "
                            "start Spinscope with its path instead"
                        )
                    file.write(chunk)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        return path

    def close(self) -> None:
        """Delete the dropped files."""
        if self._dropped is not None:
            self._dropped.cleanup()
            self._dropped = None


def _is_inside(name: str) -> bool:
    """Whether a name leads nowhere else."""
    return not os.path.isabs(name) and ".." not in PurePosixPath(name).parts and "\0" not in name and "\\" not in name


def _unused(folder: Path, name: str) -> Path:
    """A path of that name in a folder, numbered where the name is taken."""
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{Path(name).stem}-{number}{Path(name).suffix}"
    return path
