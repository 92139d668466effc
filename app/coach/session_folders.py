"""Folders of sessions: those that the user names, the user's own, and the sample."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from platformdirs import user_data_path

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.evaluation.tasks import digest
from spinscope.pipeline.session import SAMPLES

from .session import TABLE_FILE, ShotSession

SAMPLE = SAMPLES / "session"


def user_sessions_folder() -> Path:
    """Folder of the sessions that the program keeps for the user."""
    return user_data_path("spinscope", appauthor=False) / "sessions"


def sample_session() -> ShotSession:
    """The sample session, as a copy of the user's own: names and marks may be changed in it."""
    folder = user_sessions_folder() / "sample"
    if not ShotSession.is_session(folder):
        try:
            shutil.copytree(SAMPLE, folder, dirs_exist_ok=True)
        except OSError as error:
            raise RecordingError(f"the sample session cannot be copied ({error.strerror}): {folder}") from error
    return ShotSession(folder)


def live_session() -> ShotSession:
    """The user's session of a running camera's shots of today."""
    return ShotSession(user_sessions_folder() / f"live {datetime.now():%Y-%m-%d}")


def session_for(sources: Sequence[Path]) -> ShotSession:
    """The user's session of these recordings and folders, told by where they are."""
    first = sources[0].absolute()
    place = "\n".join(str(one.absolute()) for one in sources)
    name = first.name if first.is_dir() or len(sources) == 1 else first.parent.name
    return ShotSession(user_sessions_folder() / f"{name or 'session'} {digest(place)[:6]}")


def other_sessions(shown: Sequence[ShotSession]) -> list[ShotSession]:
    """The user's other sessions, the newest first."""
    folder = user_sessions_folder()
    there = [one for one in folder.glob("*") if ShotSession.is_session(one)] if folder.is_dir() else []
    folders = {session.folder.resolve() for session in shown}
    newest = sorted(there, key=lambda one: (one / TABLE_FILE).stat().st_mtime, reverse=True)
    return [ShotSession(one) for one in newest if one.resolve() not in folders]
