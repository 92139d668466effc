"""Recordings that the page may open: those of some folders with their subfolders, and files dropped onto the page."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import ReadingOptions, is_recording, open_recording

from .schemas import FolderListing, ListedRecording

DROPPED = "dropped:"  # before the names of dropped files
# All dropped files together: two of the longest that one person is likely to drag, and room on most disks.
DROPPED_BYTES = 4_000_000_000
SPARE_BYTES = 1_000_000_000  # left on the disk


class RecordingFolders:
    """Folders with their subfolders, and a bounded temporary folder of dropped files.

    A recording's name is its path within the folder with `/`, of several folders with the folder's own name before it,
    or `dropped:` and the name of the dropped file.

    Parameters
    ----------
    roots : iterable of Path
        The folders, at least one; nothing outside of them is listed or opened.
    dropped_bytes : int
        Bytes that all dropped files may have together.
    """

    def __init__(self, roots: Iterable[Path], dropped_bytes: int = DROPPED_BYTES) -> None:
        self._roots = _named(roots)
        self.dropped_bytes = dropped_bytes
        self._dropped: TemporaryDirectory[str] | None = None

    def name_of(self, path: Path) -> str:
        """Name of a recording of the folders, or of a dropped file."""
        if self._dropped is not None and path.is_relative_to(self._dropped.name):
            return DROPPED + path.name
        name, root = next((name, root) for name, root in self._roots.items() if path.is_relative_to(root))
        return PurePosixPath(name, path.relative_to(root).as_posix()).as_posix()

    def path(self, name: str) -> Path:
        """Path of the recording of a name; raises RecordingError where there is none."""
        own = name
        if name.startswith(DROPPED) and self._dropped is not None:
            own = name.removeprefix(DROPPED)
            path: Path | None = Path(self._dropped.name, own)
        else:
            path = self._below(name)
        if path is None or not _is_inside(own) or not path.is_file():
            raise RecordingError(f"there is no recording {name!r} in the opened folder: choose one of its files")
        return path

    def _below(self, name: str) -> Path | None:
        """Path of a name that leads nowhere else; None above several folders, and in none of them."""
        if list(self._roots) == [""]:
            return self._roots[""].joinpath(name)
        first, *others = PurePosixPath(name).parts or ("",)
        return self._roots[first].joinpath(*others) if first in self._roots else None

    def listing(self, subfolder: str = "") -> FolderListing:
        """Folders and recordings of a subfolder, above several folders these; raises RecordingError for another."""
        is_above = not subfolder and len(self._roots) > 1
        folder = self._below(subfolder)
        if not is_above and (folder is None or not _is_inside(subfolder) or not folder.is_dir()):
            raise RecordingError(f"there is no folder {subfolder!r} in the opened folder: choose one of its folders")
        try:
            entries = [] if folder is None else sorted(one for one in folder.iterdir() if not one.name.startswith("."))
        except OSError as error:
            raise RecordingError(f"the folder cannot be read ({error.strerror}): {folder}") from None
        dropped = [] if subfolder or self._dropped is None else sorted(Path(self._dropped.name).iterdir())
        return FolderListing(
            root=", ".join(map(str, self._roots.values())),
            folder=subfolder,
            folders=list(self._roots) if is_above else [path.name for path in entries if path.is_dir()],
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


def first_recording(folder: Path, reading: ReadingOptions) -> Path:
    """First recording of a folder, then of those below it, that can be opened; raises RecordingError for none."""
    for path in _recordings_in(folder):
        with suppress(RecordingError):
            open_recording(path, **dataclasses.asdict(reading))
            return path
    raise RecordingError(f"no recording that can be read is in this folder: {folder}")


def _recordings_in(folder: Path) -> Iterator[Path]:
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        paths = [Path(place, name) for name in sorted(files) if not name.startswith(".")]
        yield from filter(is_recording, paths)


def _named(roots: Iterable[Path]) -> dict[str, Path]:
    """Folders by their names, numbered where two have the same; a single one by none."""
    unique = list(dict.fromkeys(roots))
    named: dict[str, Path] = {}
    for root in unique:
        name, number = root.name, 1
        while name in named:
            number += 1
            name = f"{root.name}-{number}"
        named["" if len(unique) == 1 else name] = root
    return named


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
