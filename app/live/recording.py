"""Recording of a live run: the camera's events, with its settings beside them and markers of people."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import tomli_w

from spinscope.pipeline.biases import BiasParameters
from spinscope.pipeline.cameras import EventCamera, Notice, Recorder
from spinscope.pipeline.cameras.recorder import EventFile
from spinscope.pipeline.errors import ParameterError, RecordingError, SpinscopeError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import raw_file
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session

from ..terminal import note


@dataclass(frozen=True, slots=True)
class RecordChoice:
    """Options of the recording.

    Attributes
    ----------
    path : Path
        First file, NAME.raw.
    most_mb, most_s : float, optional
        Size and length at which another file begins.
    goes_on : bool
        Whether to go on behind files of these names that are there.
    """

    path: Path
    most_mb: float | None = None
    most_s: float | None = None
    goes_on: bool = False


def recorder(chosen: RecordChoice, camera: Callable[[], EventCamera], session: Session, on_notice: Notice) -> Recorder:
    """A recorder of the camera that is there when a file begins; raises SpinscopeError without a first file."""
    if chosen.path.suffix.lower() != ".raw":
        raise ParameterError(f"a camera is recorded as RAW: give a name that ends with .raw instead of {chosen.path}")

    def file(path: Path) -> EventFile:
        return raw_file(path, camera().width_px, camera().height_px, {"serial_number": camera().serial})

    return Recorder(
        chosen.path,
        file,
        beside=lambda: _texts_beside(camera(), session.parameters),
        most_bytes=None if chosen.most_mb is None else round(chosen.most_mb * 1e6),
        most_us=None if chosen.most_s is None else round(chosen.most_s * 1e6),
        goes_on=chosen.goes_on,
        on_notice=on_notice,
    )


def _texts_beside(camera: EventCamera, parameters: Parameters) -> dict[str, str]:
    """Sidecar of a recording that begins now, and the settings of camera and stages."""
    tables, known = sidecar_tables(parameters), BiasParameters.tunables()
    if known.keys() <= camera.biases.keys():
        tables["biases"] = {name: camera.biases[name] for name in known}
    device: dict[str, dict[str, Any]] = {
        "device": {"name": camera.name, "serial": camera.serial, **asdict(camera.options)},
        "device_biases": dict(camera.biases),
    }
    return {".toml": toml_text(tables), ".settings.toml": toml_text({**device, **parameters.as_dict()})}


class CameraRecording:
    """Recording that begins and ends while the camera runs: a sink of its `EventStream`.

    Parameters
    ----------
    camera : callable
        `camera() -> EventCamera`: the one that is there.
    session : Session
        Has the parameters to be kept beside the recording.
    folder : Path
        Where recordings go that nobody named.
    on_notice : callable
        Told why a recording ended early.
    """

    def __init__(self, camera: Callable[[], EventCamera], session: Session, folder: Path, on_notice: Notice) -> None:
        self._camera, self._session, self._folder, self._on_notice = camera, session, folder, on_notice
        self._recorder: Recorder | None = None
        self._lock = threading.Lock()  # of beginnings and ends

    def __call__(self, clock: int, events: EventBatch) -> None:
        """Take events; called by the camera's thread."""
        if (present := self._recorder) is not None:
            present(clock, events)

    @property
    def present(self) -> Recorder | None:
        """The recording under way; None where there is none."""
        present = self._recorder
        return present if present is not None and present.is_running else None

    def begin(self, chosen: RecordChoice | None = None) -> None:
        """Begin a recording, by default one named by date and time; raises SpinscopeError."""
        with self._lock:
            if (present := self.present) is not None:
                raise RecordingError(f"the camera is recorded already: end that recording first: {present.path}")
            self._close()
            if chosen is None:
                chosen = RecordChoice(self._folder / f"live_{datetime.now():%Y-%m-%d_%H-%M-%S}.raw")
            self._recorder = recorder(chosen, self._camera, self._session, self._on_notice)

    def end(self) -> None:
        """Finish the recording, if there is one."""
        with self._lock:
            self._close()

    def mark(self, text: str, seconds_ago: float = 0.0) -> None:
        """Note a text beside the recording, see `Recorder.mark`; raises RecordingError."""
        present = self.present
        if present is None:
            raise RecordingError("nothing is recorded, markers are kept beside a recording: begin one first")
        present.mark(text, seconds_ago)

    def _close(self) -> None:
        ended, self._recorder = self._recorder, None
        if ended is not None:
            ended.close()


def sidecar_tables(parameters: Parameters) -> dict[str, dict[str, Any]]:
    """Camera and ball as the file beside a recording states them."""
    return {"camera": parameters.camera.as_dict(), "ball": parameters.ball.as_dict()}


def toml_text(tables: dict[str, dict[str, Any]]) -> str:
    """Tables as TOML, which has no word for None."""
    stated = {name: {key: value for key, value in table.items() if value is not None} for name, table in tables.items()}
    return tomli_w.dumps(stated)


def take_markers(recording: CameraRecording) -> None:
    """Note every line that somebody types at the terminal beside the recording."""
    if not sys.stdin.isatty():
        return
    note("type a text and Enter to mark the recording")

    def read() -> None:
        for line in sys.stdin:
            try:
                recording.mark(line.strip())
            except SpinscopeError as error:
                note(str(error))

    threading.Thread(target=read, name="markers", daemon=True).start()
