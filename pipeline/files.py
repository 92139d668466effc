"""Files: those written appear complete or not at all, those read are ordinary ones of a limited size."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EFBIG, EINVAL
from pathlib import Path
from tempfile import TemporaryDirectory

from .errors import RecordingError


@contextmanager
def atomic_file(path: str | Path, what: str = "file") -> Iterator[Path]:
    """Temporary file beside `path`, which replaces it when the `with` block ends without an error.

    Parameters
    ----------
    path : str or Path
        File to create or to replace. A symbolic link is kept, and the file that it points to replaced. A device or a
        pipe (`/dev/stdout`) cannot be replaced: what the block wrote is copied to it.
    what : str
        Noun that the message begins with, like "recording" or "JSON".

    Yields
    ------
    Path
        Path to write to, not existing yet. When the block fails, the file is removed and `path` stays as it was.

    Raises
    ------
    RecordingError
        `path` is a folder or its folder does not exist, or the block or the replacement raised an OSError.
    """
    path = Path(path)
    part: Path | None = None
    try:
        if _is_device(path):
            with TemporaryDirectory() as folder:
                content = Path(folder) / "content"
                yield content
                with open(content, "rb") as source, open(path, "ab") as device:
                    shutil.copyfileobj(source, device)
            return
        check_writable(path, what)
        target = Path(os.path.realpath(path))
        part = target.with_name(f".{secrets.token_hex(8)}.part")
        yield part
        with open(part, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(part, target)
    except BrokenPipeError:
        raise  # the reader of a pipe has gone, which is for the command line to handle
    except OSError as error:
        why = error.strerror or " ".join(str(error).split())[:200]
        raise RecordingError(f"{what} cannot be written ({why}): check free space and rights: {path}") from error
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


def _is_device(path: Path) -> bool:
    """Whether a path is a device or a pipe, or standard output where that is a file."""
    there = os.path.exists(path) and not os.path.isdir(path)  # unlike Path's, these raise nothing
    return there and (not os.path.isfile(path) or path.is_relative_to("/dev"))


def file_bytes(path: Path, most_bytes: int) -> bytes:
    """Content of an ordinary file; raises OSError, with its reason in words, for devices, pipes and larger files."""
    if path.exists() and not path.is_file():
        raise OSError(EINVAL, "it is no ordinary file")
    with open(path, "rb") as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(EFBIG, f"it has over {most_bytes / 1e6:.3g} MB")
    return content


def check_writable(path: Path, what: str = "file") -> None:
    """Raise RecordingError when `path` cannot be written, for callers that have long work to do before."""
    folder = Path(os.path.realpath(path)).parent
    impossible = _impossible(path)
    if impossible:
        why = impossible
    elif path.is_dir():
        why = "it is a folder"
    elif not folder.is_dir():
        why = "its folder does not exist"
    elif not os.access(folder, os.W_OK) and not _is_device(path):
        why = "its folder may not be written to"
    else:
        return
    raise RecordingError(f"{what} cannot be written, {why}: give another name: {path}")


def _impossible(path: Path) -> str:
    """Reason in words why the system takes no such name, like one of 300 characters; empty when it does."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return ""
    except OSError as error:
        return error.strerror or str(error)
    return ""
