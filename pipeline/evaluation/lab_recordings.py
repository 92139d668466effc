"""Recordings of a folder with their truth from sidecars, for the suites that run on real recordings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..biases import BiasParameters
from ..errors import RecordingError, SpinscopeError
from ..recording_folders import recordings_in
from ..session import Choices, Session
from ..sidecar import Sidecar, StatedTruth, biases_beside
from .tables import Cell, ResultTable, Row, distinct

SPINNER, FLIGHT = "spinner", "flight"  # kinds of recordings
SIDE, TOP_BACK = "side", "top/back"  # the paper's two kinds of spin
SIDE_COSINE = math.cos(math.radians(45))  # an axis nearer the vertical than the horizontal is a sidespin's


@dataclass(frozen=True)
class LabRecording:
    """A recording of the lab and what stands beside it.

    Attributes
    ----------
    path : Path
    choices : Choices
        Options of the command line, which go before the sidecar.
    sidecar : Sidecar
    """

    path: Path
    choices: Choices
    sidecar: Sidecar

    @classmethod
    def of(cls, path: Path, choices: Choices) -> LabRecording:
        """The recording at a path; raises SpinscopeError where its sidecar is wrong."""
        return cls(path, choices, Sidecar.beside(path))

    @property
    def kind(self) -> str:
        """SPINNER where the sidecar states the circle of a fixed ball, else FLIGHT."""
        return FLIGHT if self.sidecar.fixed_ball is None else SPINNER

    @property
    def stated(self) -> StatedTruth:
        """The sidecar's truth; raises RecordingError without."""
        if self.sidecar.truth is None:
            raise RecordingError(
                "no truth: state [truth] spin_rps = [x, y, z], axis and rps, or rps in "
                f"{self.path.with_suffix('.toml').name}, or a line of truth.csv"
            )
        return self.sidecar.truth

    @property
    def biases(self) -> BiasParameters:
        """The biases of `NAME.bias` or of the sidecar; raises RecordingError without."""
        biases = biases_beside(self.path)
        if biases is None:
            names = self.path.with_suffix(".bias").name, self.path.with_suffix(".toml").name
            raise RecordingError(f"no biases: put {names[0]} beside it, or [biases] in {names[1]}")
        return biases

    @property
    def kind_of_spin(self) -> str | None:
        """SIDE or TOP_BACK, by a word of the setting, else by the axis; None where neither tells."""
        truth = self.stated
        words = (truth.setting or "").lower().replace("/", " ").replace(",", " ").split()
        for word in words:
            if word.startswith(("side", "top", "back")):
                return SIDE if word.startswith("side") else TOP_BACK
        if truth.spin_rps is None or truth.rps == 0:
            return None
        up = self.session.camera.up
        cosine = abs(sum(a * b for a, b in zip(truth.spin_rps, up, strict=True))) / truth.rps
        return SIDE if cosine > SIDE_COSINE else TOP_BACK

    @cached_property
    def session(self) -> Session:
        """The open recording, of its whole length; raises SpinscopeError."""
        return Session.open(self.path, self.choices)

    def from_whole_ticks(self, start_ms: float, end_ms: float) -> Session:
        """A session of a part, counted from the start of the tick with the first event, so that no tick is cut."""
        start_us, _ = self.span_us
        return self.session.clip(round(start_us + start_ms * 1000), round(start_us + end_ms * 1000))

    @property
    def span_us(self) -> tuple[int, int]:
        """Start of the tick with the first event, and end of that with the last, file time."""
        source, tick_us = self.session.source, self.session.parameters.track.tick_us
        return source.start_us // tick_us * tick_us, -(-source.end_us // tick_us) * tick_us


@dataclass(frozen=True)
class LabFolder:
    """The recordings of a folder, and of those that cannot be used why.

    Attributes
    ----------
    path : Path
    recordings : tuple of LabRecording
    wrong : dict of str to str
        Error of the sidecar by name of the recording.
    """

    path: Path
    recordings: tuple[LabRecording, ...]
    wrong: dict[str, str]

    @classmethod
    def of(cls, path: Path, choices: Choices, ball: int | None = None) -> LabFolder:
        """The recordings of a folder and those below, of one ball (1 to 7) where asked for; raises RecordingError."""
        if not path.is_dir():
            raise RecordingError(f"there is no folder of recordings: give one that is there: {path}")
        found, wrong = [], {}
        for file in recordings_in([path]):
            try:
                recording = LabRecording.of(file, choices)
            except SpinscopeError as error:
                wrong[file.relative_to(path).as_posix()] = str(error)
                continue
            truth = recording.sidecar.truth
            if ball is None or (truth is not None and truth.ball == ball):
                found.append(recording)
        return cls(path, tuple(found), wrong)


def recordings_table(folder: LabFolder, kinds: Sequence[str], rows: Sequence[Row]) -> ResultTable:
    """Number of recordings by what became of them in a suite, and the names of those left out, with the reason."""
    of_kind = Counter(recording.kind for recording in folder.recordings)
    failed = {str(row["recording"]): str(row["error"]) for row in rows if "error" in row} | folder.wrong
    good = [row for row in rows if "error" not in row]
    done, sensors = distinct(good, "recording"), distinct(good, "sensor")
    lines: list[tuple[Cell, ...]] = [("evaluated", len(done), None)]
    lines += [
        (f"not for this suite: {kind}", count, None) for kind, count in sorted(of_kind.items()) if kind not in kinds
    ]
    lines += [("left out", None, f"{name}: {reason}") for name, reason in sorted(failed.items())]
    if len(sensors) > 1:
        remedy = "state each camera in its recordings' sidecars, or keep each in its own folder"
        lines.append(("mixed sensors", len(sensors), f"{', '.join(sorted(sensors))}: {remedy}"))
    return ResultTable(
        "Real recordings", ("recordings", "n", "which, and why"), lines, f"Of the folder {folder.path.name}."
    )
