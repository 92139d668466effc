"""Shots of a recording as a session keeps them: numbers, flight, logo and proof, with their events and pictures."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from spinscope.app.analysis import analyzed
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.shots import Shot
from spinscope.pipeline.spin.trajectory.motion import RADIUS_STD_PX
from spinscope.pipeline.spin_terms import kind_of_spin

from .ball_picture import ball_picture
from .logo_texture import LogoEvents, logo_texture, spin_proof

Floats = NDArray[np.float64]
ToldBy = Literal["logo", "rhythm", "flight"]

# Attributes of the recording of one shot, which holds some of the flights before and after it, too: its time, us.
SHOT_START, SHOT_END = "shot.start_us", "shot.end_us"
NEAR_BALL = 1.6  # radii around the ball whose events a shot's recording keeps: outline, logo and some ground
PARTS = {"topspin_rps": "topspin", "sidespin_rps": "left sidespin", "corkscrew_rps": "corkscrew"}
PICTURE_PX = 96


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotRecord:
    """One shot of a session; None for what is not known.

    Attributes
    ----------
    recording, recording_hash : str
        File that it was found in, and hash of its content.
    shot : int
        Number in the recording, from 1.
    recorded_s : float
        When it ended, seconds since 1970 (UTC): by the time of the recording's file.
    began_by, ended_by : str
        As `analyze` writes them.
    spin_rps, spin_std_rps, axis_std_deg : float, optional
        Magnitude and stated errors of the trusted answer.
    topspin_rps, sidespin_rps, corkscrew_rps : float, optional
        Signed components; sidespin is positive to the left, corkscrew to the right.
    method, told_by : str, optional
        Trusted method, and whether the logo, its rhythm or the flight alone tells the spin.
    reason : str, optional
        Why no spin is trusted.
    events_file, picture_file : str, optional
        Recording of the events near the ball and picture of the ball, in the session's folder.
    detail : str
        JSON of what the shot's view draws, see `shot_detail`.
    """

    recording: str
    recording_hash: str
    shot: int
    start_us: int
    end_us: int
    recorded_s: float
    began_by: str
    ended_by: str
    speed_m_s: float | None
    spin_rps: float | None = None
    spin_std_rps: float | None = None
    axis_std_deg: float | None = None
    topspin_rps: float | None = None
    sidespin_rps: float | None = None
    corkscrew_rps: float | None = None
    method: str | None = None
    told_by: str | None = None
    reason: str | None = None
    events_file: str | None = None
    picture_file: str | None = None
    detail: str = "{}"

    def values(self) -> dict[str, Any]:
        """The fields by name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


@dataclass(frozen=True, slots=True)
class RecordingShots:
    """Shots of one recording, or the reason why there are none."""

    shots: tuple[ShotRecord, ...]
    no_shot_reason: str | None
    warnings: tuple[str, ...]


def analyze_for_session(path: Path, recording_hash: str, choices: Choices, folder: Path) -> RecordingShots:
    """Analyze a recording and write its shots' events and pictures into a session's folder; raises SpinscopeError."""
    result = analyzed(path, choices)
    session = result.session
    logos = _logo_events(session) if result.shots else {}
    end_s = path.stat().st_mtime
    records = []
    for number, shot in enumerate(_wanted(result), start=1):
        name = f"{recording_hash[:12]}-{number}"
        record = _record(result, shot, logos.get(shot.number), number)
        record |= {"recording": str(path), "recording_hash": recording_hash}
        record["recorded_s"] = end_s + (shot.end_us - session.source.end_us) * 1e-6
        record["events_file"] = f"events/{name}.h5"
        _write_events(session, shot, folder / record["events_file"])
        picture = ball_picture(json.loads(record["detail"]), PICTURE_PX)
        if picture is not None:
            record["picture_file"] = f"pictures/{name}.png"
            (folder / record["picture_file"]).write_bytes(_png(picture))
        records.append(ShotRecord(**record))
    return RecordingShots(tuple(records), result.no_shot_reason, tuple(session.warnings))


def _wanted(result: Result) -> tuple[Shot, ...]:
    """The shots of a result; of the recording of one shot, that one."""
    attributes = result.session.recording.attributes
    if not result.shots or SHOT_START not in attributes:
        return result.shots
    start_us, end_us = float(attributes[SHOT_START]), float(attributes[SHOT_END])
    return (max(result.shots, key=lambda shot: min(shot.end_us, end_us) - max(shot.start_us, start_us)),)


def live_record(result: Result, recording: str, ended_s: float) -> ShotRecord:
    """Record of the only shot of a result, without logo and files, which nobody has looked for yet.

    Parameters
    ----------
    recording : str
        File of its events.
    ended_s : float
        When it ended, seconds since 1970 (UTC).
    """
    (shot,) = result.shots
    record = _record(result, shot, None, 1)
    return ShotRecord(**record, recording=recording, recording_hash="", recorded_s=ended_s)


def _record(result: Result, shot: Shot, logo: LogoEvents | None, number: int) -> dict[str, Any]:
    """The fields of a record but those of its files."""
    session = result.session
    is_fixed = session.parameters.track.ball == "fixed"
    velocity = None if is_fixed else shot.velocity_m_s(session.camera, session.ball_radius_m)
    record: dict[str, Any] = {
        "shot": number,
        "start_us": shot.start_us,
        "end_us": shot.end_us,
        "began_by": shot.began_by,
        "ended_by": shot.ended_by,
        "speed_m_s": None if velocity is None else float(np.linalg.norm(velocity)),
        "reason": shot.best_reason,
    }
    trusted = shot.estimates[shot.best] if shot.best is not None else None
    if trusted is not None and trusted.vector_rps is not None:
        kind = kind_of_spin(trusted.vector_rps, velocity, session.camera.up)
        record |= {
            "spin_rps": trusted.magnitude_rps,
            "spin_std_rps": trusted.magnitude_std_rps,
            "axis_std_deg": trusted.axis_std_deg,
            "method": trusted.method,
            "told_by": _told_by(shot, trusted.method),
        }
        record |= {column: kind.parts_rps.get(part) for column, part in PARTS.items()}
    record["detail"] = json.dumps(shot_detail(session, shot, trusted, velocity, logo), separators=(",", ":"))
    return record


def shot_detail(
    session: Session, shot: Shot, trusted: SpinEstimate | None, velocity_m_s: Floats | None, logo: LogoEvents | None
) -> dict[str, Any]:
    """Drawn details of a shot, ready for JSON.

    Returns
    -------
    dict
        `path`: `t_us` and centres `x_m, y_m, z_m` (camera frame) of its ticks; `depth_std_m`: error that all their
        distances have in common; `hitter`: rows right, up and forward
        of the hitter's frame in that of the camera (None where the ball does not fly level); `line_of_sight`: unit
        vector from the camera to the ball; and with a trusted answer `spin_rps` (camera frame), `reference_us`,
        `texture` (PNG in base64, `logo_texture`) and `proof` (`SpinProof`), None without logo events.
    """
    places = shot.positions_m(session.camera, session.ball_radius_m)
    middle = places.mean(axis=0)
    sight = middle / np.linalg.norm(middle)
    columns = zip(("x_m", "y_m", "z_m"), places.T.round(4).tolist(), strict=True)
    detail: dict[str, Any] = {
        "path": {"t_us": shot.t_us.round().astype(int).tolist(), **dict(columns)},
        "depth_std_m": float(RADIUS_STD_PX / shot.state[:, 4].mean() * np.linalg.norm(middle)),
        "hitter": hitter_frame(velocity_m_s, np.array(session.camera.up)),
        "line_of_sight": sight.tolist(),
        "spin_rps": None,
        "reference_us": float(shot.start_us + shot.end_us) / 2,
        "texture": None,
        "proof": None,
    }
    if trusted is None or trusted.vector_rps is None:
        return detail
    detail["spin_rps"] = trusted.vector_rps.tolist()
    if logo is not None and len(logo.t_us):
        texture = logo_texture(logo, trusted.vector_rps, detail["reference_us"])
        detail["texture"] = base64.b64encode(_png(texture)).decode()
        proof = spin_proof(logo, trusted.vector_rps, sight)
        if proof is not None:
            points = {name: getattr(proof, name).round(3).tolist() for name in ("first", "second", "turned")}
            detail["proof"] = {"first_us": proof.first_us, "second_us": proof.second_us, **points}
    return detail


def hitter_frame(velocity_m_s: Floats | None, up: Floats) -> list[list[float]] | None:
    """Rows right, up, forward (level) as the hitter sees them, camera frame; None without a level flight."""
    if velocity_m_s is None:
        return None
    level = velocity_m_s - (velocity_m_s @ up) * up
    if np.linalg.norm(level) < 0.1 * np.linalg.norm(velocity_m_s):
        return None
    forward = level / np.linalg.norm(level)
    frame: list[list[float]] = np.stack([np.cross(forward, up), up, forward]).tolist()
    return frame


def _told_by(shot: Shot, method: str) -> ToldBy:
    if method == "trajectory":
        return "flight"
    basis = shot.combined.basis if method == "combined" and shot.combined is not None else None
    return basis if basis in ("rhythm", "flight") else "logo"


def _logo_events(session: Session) -> dict[int, LogoEvents]:
    """The logo's events of every shot, by the track's numbers."""
    parts: dict[int, list[Any]] = {}
    for tick in session.ticks(("logo",), forget=STAGES.names):
        for ball in tick.balls:
            found = parts.setdefault(ball.track.shot, [])
            found += [one.results["logo"].turning for one in (*ball.earlier, ball)]
    return {
        shot: LogoEvents(*(np.concatenate([getattr(part, name) for part in own]) for name in ("t_us", "on", "normals")))
        for shot, own in parts.items()
    }


def _write_events(session: Session, shot: Shot, path: Path) -> None:
    """Write the events near the ball as a recording of their own, with what is stated of camera and ball."""
    source, parameters = session.source, session.parameters
    events = source.between(shot.start_us, shot.end_us)
    x, y, radius = (np.interp(events.t_us, shot.t_us, shot.state[:, column]) for column in (0, 1, 4))
    near = np.hypot(events.x_px - x, events.y_px - y) < NEAR_BALL * radius
    attributes = dict(_stated(parameters.camera, "camera")) | dict(_stated(parameters.ball, "ball"))
    write_recording(path, events[near], width_px=source.width_px, height_px=source.height_px, attributes=attributes)


def _stated(group: Any, name: str) -> Iterator[tuple[str, str | float]]:
    """Values that differ from the defaults, as attributes of a recording."""
    plain = type(group)()
    for field in group.tunables():
        value = getattr(group, field)
        if value != getattr(plain, field):
            yield f"{name}.{field}", ",".join(map(repr, value)) if isinstance(value, tuple) else value


def _png(picture: NDArray[np.uint8]) -> bytes:
    import cv2  # 60 ms to load

    return bytes(cv2.imencode(".png", picture if picture.ndim == 2 else picture[..., ::-1])[1])
