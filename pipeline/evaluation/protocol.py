"""Check of a folder of real recordings against the recording protocol (docs/recording_protocol.md)."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from ..biases import PAPER
from ..errors import SpinscopeError
from ..recordings import Recording
from .lab_recordings import SPINNER, LabFolder, LabRecording

SHOTS_A_SETTING = 5  # the paper's (supplement, "Ball thrower benchmark")
SPINNER_MS = 100  # the paper's longer time of observation (table 1)


@dataclass(frozen=True, slots=True)
class ProtocolFinding:
    """Departure of a recording, or of the folder, from the protocol, with the remedy, in words."""

    recording: str
    what: str


def protocol_findings(folder: LabFolder) -> list[ProtocolFinding]:
    """Everything in which a folder departs from the protocol, recording by recording, then as a whole."""
    findings = [ProtocolFinding(name, error) for name, error in folder.wrong.items()]
    sensors: Counter[tuple[int, int]] = Counter()
    shots: dict[str, int] = defaultdict(int)
    for recording in folder.recordings:
        name = recording.path.relative_to(folder.path).as_posix()
        try:
            findings += [ProtocolFinding(name, what) for what in _lacking(recording)]
        except SpinscopeError as error:
            findings.append(ProtocolFinding(name, str(error)))
            continue
        source, truth = recording.session.source, recording.sidecar.truth
        sensors[source.width_px, source.height_px] += 1
        if truth is not None and truth.setting and recording.kind != SPINNER:
            shots[truth.setting] += 1
    if len(sensors) > 1:
        sizes = ", ".join(f"{count} of {width} x {height} px" for (width, height), count in sensors.most_common())
        findings.append(ProtocolFinding(folder.path.name, f"sensors are mixed ({sizes}): keep each in its own folder"))
    for setting, count in shots.items():
        if count < SHOTS_A_SETTING:
            what = f"setting {setting!r} has {count} shots: record {SHOTS_A_SETTING}, a thrower scatters"
            findings.append(ProtocolFinding(folder.path.name, what))
    return findings


def _lacking(recording: LabRecording) -> Iterator[str]:
    """Departures of one recording; raises SpinscopeError where it cannot be opened."""
    session, sidecar, toml = recording.session, recording.sidecar, recording.path.with_suffix(".toml").name
    start_us, end_us = recording.span_us
    if isinstance(session.recording, Recording) and session.recording.sensor_from == "guess":
        yield "the file does not state its sensor: give --sensor WxH to `spinscope convert` and keep the result"
    if not session.states_focal_length:
        yield f"the camera is not stated: [camera] focal_length_mm in {toml}, or the result of `calibrate camera`"
    if sidecar.truth is None:
        yield f"no truth: [truth] in {toml}, or a line of truth.csv"
    elif sidecar.truth.ball is None:
        yield f"the ball's number (1 to 7) is not stated: [truth] ball in {toml}"
    if sidecar.truth is not None and sidecar.truth.spin_rps is None:
        yield f"the truth is a magnitude only: [truth] axis = [x, y, z] (camera frame) in {toml} tells the axis, too"
    try:
        biases = recording.biases
    except SpinscopeError as error:
        yield str(error)
    else:
        changed = [name for name in biases.tunables() if getattr(biases, name) != getattr(PAPER, name)]
        if changed:
            yield f"biases {', '.join(changed)} are not the paper's: compare its numbers with care"
    if recording.kind == SPINNER and end_us - start_us < SPINNER_MS * 1000:
        yield f"it lasts {(end_us - start_us) / 1000:g} ms: record {SPINNER_MS} ms or more of a ball on a spinner"
    if recording.kind != SPINNER and sidecar.truth is not None:
        if sidecar.truth.speed_m_s is None:
            yield f"the speed is not stated: [truth] speed_m_s in {toml}; of a ball on a spinner, state [fixed_ball]"
        dotted = sidecar.truth.dotted_shots
        if dotted is not None and dotted < SHOTS_A_SETTING:
            yield f"its truth is the mean of {dotted} dotted shots: shoot {SHOTS_A_SETTING} at each setting"
        if not sidecar.truth.setting:
            yield f"the thrower's setting is not stated: [truth] setting in {toml}"
