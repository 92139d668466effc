"""State of the web application: the open recordings of some folders and the sessions of its clients."""

from __future__ import annotations

import os
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.pipeline.calibration.ball_labels import labels_beside
from spinscope.pipeline.calibration.label_file import LabelFile
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.recordings.recording import file_identity
from spinscope.pipeline.session import Choices, Progress

from .client_session import ClientSession
from .live_schemas import LiveSource
from .open_recording import VIEW_FRAMES_BYTES, OpenRecording
from .recording_folder import RecordingFolders
from .recording_summary import summarize
from .schemas import RecordingSummary
from .shot_detection_job import ShotDetectionJob

RECORDINGS_KEPT = 2  # each holds up to 110 MB of events
SESSIONS_MOST = 16  # a page opened beyond them takes the place of one that was left
ALONE_S = 20.0  # a session without its browser for so long is closed; a reload takes less


class AppState:
    """Open recordings and client sessions.

    Parameters
    ----------
    path : Path
        Recording that was asked for.
    choices : Choices
        What was chosen on the command line.
    folders : sequence of Path
        Folders whose recordings, and those below, may be opened from the page; the recording lies in one of them. By
        default its own.
    tools : bool
        Whether the page shows its tools (`tune`), or the viewer alone (`view`).
    layout : str
        Layout of the viewer in front.
    followed : int, optional
        Number of the shot, from 1, whose ball the detail views follow.
    live : LiveSource, optional
        Running camera that the recordings of the folder come from.
    labels : Path, optional
        Labels of the ball in the recording that was asked for, which the page shows at once (`label --view`).

    Attributes
    ----------
    folders : RecordingFolders
        Recordings that may be opened.
    sessions : dict
        Open sessions by id.
    """

    def __init__(
        self,
        path: Path,
        choices: Choices,
        *,
        folders: Sequence[Path] = (),
        tools: bool = True,
        layout: str = "all",
        followed: int | None = None,
        live: LiveSource | None = None,
        labels: Path | None = None,
    ) -> None:
        self.path = Path(os.path.abspath(path))  # also without "..", which no name may hold
        self.folders = RecordingFolders([Path(os.path.abspath(one)) for one in folders] or [self.path.parent])
        self.tools, self.layout, self.followed, self.live = tools, layout, followed, live
        self.labels = labels
        self.drawings = DrawingCache()
        self._choices = choices
        self._recordings: OrderedDict[Path, OpenRecording] = OrderedDict()
        self._detections: dict[Path, ShotDetectionJob] = {}
        self._summaries: dict[str, RecordingSummary] = {}
        self._summarizing = threading.Lock()
        self._label_files: dict[Path, LabelFile] = {}
        self._scratch: TemporaryDirectory[str] | None = None
        self.sessions: dict[str, ClientSession] = {}
        self._lock = threading.Lock()

    def recording(self, name: str | None = None, on_progress: Progress | None = None) -> OpenRecording:
        """The recording of that name in the folders, opened when it is not yet; raises SpinscopeError."""
        path = self.path if name is None else self.folders.path(name)
        with self._lock:
            recording = self._recordings.pop(path, None)
            if recording is None:
                choices = self._choices if path == self.path else self._choices.for_others
                frames_bytes = None if self.tools else VIEW_FRAMES_BYTES
                recording = OpenRecording.open(path, choices, frames_bytes=frames_bytes, on_progress=on_progress)
            self._recordings[path] = recording
            while len(self._recordings) > RECORDINGS_KEPT:
                detection = self._detections.pop(self._recordings.popitem(last=False)[0], None)
                if detection is not None:
                    detection.close()
            return recording

    def summary(self, name: str) -> RecordingSummary:
        """Summary of a recording of the folders, one at a time and once for each content; raises RecordingError."""
        path = self.folders.path(name)
        with self._summarizing:
            identity = file_identity(path)
            if identity not in self._summaries:
                choices = self._choices if path == self.path else self._choices.for_others
                self._summaries[identity] = summarize(path, choices, self._make_way)
            return self._summaries[identity]

    def labels_of(self, recording: OpenRecording) -> LabelFile:
        """The file of a recording's labels, whether it is there or not; one for all sessions."""
        chosen = self.labels if recording.original == self.path else None
        path = chosen or labels_beside(recording.original)
        return self._label_files.setdefault(path, LabelFile(path))

    def _make_way(self, share: float, text: str) -> None:
        """Progress of work in the background: it waits while somebody waits for a picture."""
        for recording in list(self._recordings.values()):
            recording.make_way()

    def open_session(self, name: str | None) -> ClientSession:
        """Open a session on a recording; raises SpinscopeError."""
        recording = self.recording(name)
        self.close_lonely_sessions()
        with self._lock:
            left = [one for one in self.sessions.values() if one.listeners == 0]
            longest_left = min(left, key=lambda one: one.last_sign_of_life_s, default=None)
            if len(self.sessions) < SESSIONS_MOST:
                longest_left = None
            elif longest_left is None:
                raise ParameterError(f"{SESSIONS_MOST} pages are open: close one of them")
            session = ClientSession(recording, self.drawings)
            self.sessions[session.id] = session
        if longest_left is not None:
            self.close_session(longest_left)
        self.detect_shots(session)
        return session

    def detect_shots(self, session: ClientSession) -> None:
        """Report the shots of a long recording to a session, searching for them when nobody has yet."""
        recording = session.runner.recording
        if recording.is_long:
            path = recording.session.recording.path
            if path not in self._detections:
                self._detections[path] = ShotDetectionJob(recording, recording.session.parameters)
            self._detections[path].add(session.messages)

    @property
    def scratch(self) -> Path:
        """A folder for simulated recordings; it goes with the program."""
        if self._scratch is None:
            self._scratch = TemporaryDirectory(prefix="spinscope-")
        return Path(self._scratch.name)

    def close_lonely_sessions(self) -> None:
        """Close the sessions that no browser has listened to for a while."""
        now_s = time.monotonic()
        for session in list(self.sessions.values()):
            if session.listeners == 0 and now_s - session.last_sign_of_life_s > ALONE_S:
                self.close_session(session)

    def close_session(self, session: ClientSession) -> None:
        """End a session: its run, its jobs and its connection."""
        self.sessions.pop(session.id, None)
        session.close()
        for detection in list(self._detections.values()):
            detection.remove(session.messages)

    def close(self) -> None:
        """Close all sessions, wait for all threads, and leave nothing behind."""
        sessions = list(self.sessions.values())
        for session in sessions:
            session.close()
        for detection in self._detections.values():
            detection.close()
        for session in sessions:
            session.join(2.0)
        self.drawings.close()
        self.folders.close()
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None
