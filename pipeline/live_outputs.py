"""Results of a live run, each of which is a line of JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .camera import Camera
from .cameras import NoticeKind
from .shots import Shot
from .spin_so_far import SpinSoFar
from .stages.track_result import BallTrack, EndedBy


@dataclass(frozen=True, slots=True, eq=False)
class LiveBall:
    """A ball in view as soon as the tracker knows it, for robots.

    Attributes
    ----------
    track : BallTrack
        Its state.
    latency_ms : float
        From the arrival of the tick's first events to this.
    """

    track: BallTrack
    latency_ms: float

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        x, y, vx, vy, radius = self.track.mean.tolist()
        state = {"x_px": x, "y_px": y, "radius_px": radius, "vx_px_s": vx, "vy_px_s": vy}
        about = {"shot": self.track.shot, "t_us": self.track.t_us, "measured": self.track.measured is not None}
        return {"ball": {**about, **state, "latency_ms": self.latency_ms}}


@dataclass(frozen=True, slots=True, eq=False)
class LiveSpin:
    """Spin of a ball in flight from its shot so far, or of one that has just ended: not final, `LiveShot` is.

    Attributes
    ----------
    shot, t_us : int
        Number of the shot, and end of its tick, or of the shot where that has ended.
    spin : SpinSoFar
        The estimate, and what it is from.
    ended_by : str, optional
        How the shot has ended; None while the ball flies.
    latency_ms : float
        From the arrival of the tick's first events to this; from that of the shot's last events where it has ended.
    """

    shot: int
    t_us: int
    spin: SpinSoFar
    ended_by: EndedBy | None
    latency_ms: float

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON: `spin` of a flying ball, `announced` of a shot that has ended."""
        estimate = self.spin.estimate
        about = {"shot": self.shot, "t_us": self.t_us, "method": estimate.method, "from_events_to_us": self.spin.t_us}
        if self.ended_by is not None:
            about["ended_by"] = self.ended_by
        return {
            "spin" if self.ended_by is None else "announced": {
                **about,
                "vector_rps": None if estimate.vector_rps is None else estimate.vector_rps.tolist(),
                "magnitude_std_rps": estimate.magnitude_std_rps,
                "axis_std_deg": estimate.axis_std_deg,
                "reason": estimate.reason,
                "latency_ms": self.latency_ms,
            }
        }


@dataclass(frozen=True, slots=True, eq=False)
class LiveShot:
    """A shot that has ended.

    Attributes
    ----------
    shot : Shot
        As of a recording.
    clock : int
        Number of the camera's clock, from 0, that its times are of.
    recorded_us : int
        Time up to which events had been taken when the end was known.
    latency_ms : float
        From the arrival of the shot's last events to this; 0 where the camera ended with the shot.
    """

    shot: Shot
    clock: int
    recorded_us: int
    latency_ms: float

    def to_dict(self, camera: Camera, ball_radius_m: float) -> dict[str, Any]:
        """The object of a line of JSON: as `analyze` writes a shot, with the attributes above."""
        written = self.shot.to_dict(camera, ball_radius_m)
        return {**written, "clock": self.clock, "recorded_us": self.recorded_us, "latency_ms": self.latency_ms}


@dataclass(frozen=True, slots=True)
class LiveStatus:
    """State of the last second.

    Attributes
    ----------
    events : int
        Events since the start.
    rate_mev_s : float
        Millions of events a second.
    dropped, outside, late, skipped : int
        As of `StreamCounts`, since the start.
    backlog_ms : float
        Events that came and are not tracked yet.
    spin_backlog_ms : float
        Those that are tracked and have no spin yet.
    p50_ms, p99_ms : float, optional
        Latencies from the arrival of a tick's first events to its track; None without ticks.
    """

    events: int
    rate_mev_s: float
    dropped: int
    outside: int
    late: int
    skipped: int
    backlog_ms: float
    spin_backlog_ms: float
    p50_ms: float | None
    p99_ms: float | None

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        return {"status": asdict(self)}


@dataclass(frozen=True, slots=True)
class LiveNotice:
    """Incident of the camera or the work: its kind, and a sentence for people."""

    kind: NoticeKind
    text: str

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        return {"notice": self.text}


LiveOutput = LiveBall | LiveSpin | LiveShot | LiveStatus | LiveNotice
