"""`spinscope analyze`: the shots of a recording as JSON for programs and as a table for people."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.shots import Shot

from .session import Choices, Progress, Session

TRACKING = ("filter", "surface", "track", "logo")
SCHEMA = 1


def analyze(
    path: Path, choices: Choices, method: str, on_progress: Progress | None = None, *, cold: bool = True
) -> dict[str, Any]:
    """The report on one recording (tests/app/analyze.schema.json); raises SpinscopeError.

    cold : whether this is the process's first; loading the kernels is then told apart from the work itself
    """
    begin = time.perf_counter()
    session = Session.open(path, choices, on_progress)
    load_seconds = session.load_kernels(method) if cold else 0.0
    log = session.shots(on_progress, method)
    made = report(session, log.shots, log.no_shot_reason, method)
    made["recording"]["path"] = str(path)
    made["seconds"]["load"] = load_seconds
    made["seconds"]["total"] = time.perf_counter() - begin
    return made


def report(session: Session, shots: Sequence[Shot], no_shot_reason: str | None, method: str = "all") -> dict[str, Any]:
    """The report on the shots found in a session; its total is what reading and the stages took."""
    seconds = session.chain.seconds
    return {
        "schema": SCHEMA,
        "recording": {
            "path": str(session.recording.path),
            "events": len(session.source.events),
            "duration_us": session.source.end_us - session.source.start_us,
            "width": session.source.width_px,
            "height": session.source.height_px,
        },
        "parameters": session.parameters.as_dict(),
        "shots": [_shot(session, shot, method) for shot in shots],
        "no_shot_reason": no_shot_reason,
        "warnings": session.warnings,
        "seconds": {
            "read": session.read_seconds,
            "track": sum(seconds[stage] for stage in TRACKING),
            "spin": sum(taken for stage, taken in seconds.items() if stage not in TRACKING),
            "total": session.read_seconds + sum(seconds.values()),
        },
    }


def _shot(session: Session, shot: Shot, method: str) -> dict[str, Any]:
    velocity = shot.velocity_m_s(session.camera, session.ball_radius_m)
    x, y, vx, vy, radius = shot.state.T.tolist()
    x_std, y_std, _, _, radius_std = shot.std.T.tolist()
    estimates = {name: estimate for name, estimate in shot.estimates.items() if method in ("all", name)}
    return {
        "start_us": shot.start_us,
        "end_us": shot.end_us,
        "track": {
            "t_us": shot.t_us.tolist(),
            "x_px": x,
            "y_px": y,
            "radius_px": radius,
            "vx_px_s": vx,
            "vy_px_s": vy,
            "x_std_px": x_std,
            "y_std_px": y_std,
            "radius_std_px": radius_std,
            "measured": shot.measured.astype(int).tolist(),
        },
        "speed_m_s": None if velocity is None else math.sqrt(float(velocity @ velocity)),
        "logo_events": shot.logo_events,
        "spin": {name: _estimate(estimate) for name, estimate in estimates.items()},
        "best": shot.best if shot.best in estimates else None,
    }


def _estimate(estimate: SpinEstimate) -> dict[str, Any]:
    axis = estimate.axis
    return {
        "status": estimate.status,
        "reason": estimate.reason,
        "vector_rps": None if estimate.vector_rps is None else estimate.vector_rps.tolist(),
        "magnitude_rps": estimate.magnitude_rps,
        "magnitude_std_rps": estimate.magnitude_std_rps,
        "axis": None if axis is None else axis.tolist(),
        "axis_std_deg": estimate.axis_std_deg,
    }
