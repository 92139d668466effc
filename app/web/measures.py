"""What a run comes to in numbers: for the table of A and B, the tuning curve and the search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.chain import Tick
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import Result, Session
from spinscope.pipeline.shots import Shot
from spinscope.pipeline.spin_terms import Kind, kind_of_spin, km_h, rpm

Floats = NDArray[np.float64]


def measures(result: Result) -> dict[str, Any]:
    """The numbers of a run, ready for JSON; None where there is nothing to be said.

    tracked_share : share of the ticks in which a circle was measured
    residual_px : rms of the measured circles' distance from the filter's, centre and radius together
    jitter_px : 1 sigma of the noise of the measured centres across one axis, from their second differences
    logo_events : in all shots
    shots : each with start_us, end_us, speed_m_s, best, kind, the coach's sentence, and every method's estimate
    """
    session, ticks = result.session, result.ticks
    return {
        "ticks": len(ticks),
        "tracked_share": sum(tick.track.measured is not None for tick in ticks) / max(len(ticks), 1),
        "residual_px": _residual_px(ticks),
        "jitter_px": _jitter_px(ticks),
        "logo_events": sum(len(tick.logo.events) for tick in ticks),
        "shots": [_shot(session, shot) for shot in result.shots],
        "no_shot_reason": result.no_shot_reason,
    }


def main_shot(measured: dict[str, Any]) -> dict[str, Any] | None:
    """The shot with the most logo events, which has most to say; None when there is none."""
    shots: list[dict[str, Any]] = measured["shots"]
    return max(shots, key=lambda shot: shot["logo_events"], default=None)


def _residual_px(ticks: Sequence[Tick]) -> float | None:
    squares = []
    for tick in ticks:
        circle = tick.track.measured
        if circle is not None and tick.track.has_ball:
            x, y, _, _, radius = tick.track.mean
            squares.append((circle.x_px - x) ** 2 + (circle.y_px - y) ** 2 + (circle.radius_px - radius) ** 2)
    return _finite(math.sqrt(np.mean(squares))) if squares else None


def _jitter_px(ticks: Sequence[Tick]) -> float | None:
    """Second differences of white noise of 1 sigma have sqrt(6) sigma; the flight's own are 0.01 px at 200 Hz."""
    seconds: list[Floats] = []
    places: list[Floats] = []
    shot: int | None = None
    for tick in ticks:
        circle = tick.track.measured
        if circle is None or tick.track.shot != shot:
            places, shot = [], tick.track.shot
        if circle is not None and shot is not None:
            places.append(np.array([circle.x_px, circle.y_px]))
        if len(places) >= 3:
            seconds.append(places[-1] - 2 * places[-2] + places[-3])
    return _finite(math.sqrt(np.mean(np.square(seconds)) / 6)) if seconds else None


def _shot(session: Session, shot: Shot) -> dict[str, Any]:
    velocity = (
        None if session.parameters.track.ball == "fixed" else shot.velocity_m_s(session.camera, session.ball_radius_m)
    )
    trusted = shot.estimates[shot.best] if shot.best is not None else None
    kind = None
    if trusted is not None and trusted.vector_rps is not None:
        kind = kind_of_spin(trusted.vector_rps, velocity, session.camera.up)
    return {
        "start_us": shot.start_us,
        "end_us": shot.end_us,
        "logo_events": shot.logo_events,
        "speed_m_s": None if velocity is None else _finite(float(np.linalg.norm(velocity))),
        "best": shot.best,
        "kind": kind.name if kind else None,
        "sentence": coach_sentence(trusted, kind, velocity),
        "spin": {name: _estimate(session, shot, estimate) for name, estimate in shot.estimates.items()},
    }


def coach_sentence(estimate: SpinEstimate | None, kind: Kind | None, velocity_m_s: Floats | None) -> str:
    """`Topspin 54 rps (3240 rpm), 32 km/h, axis 12 degrees off pure topspin, ±2 rps`, or that it is not known."""
    speed = [] if velocity_m_s is None else [f"{km_h(float(np.linalg.norm(velocity_m_s))):.0f} km/h"]
    if estimate is None or kind is None or estimate.magnitude_rps is None:
        return ", ".join(["Spin not known", *speed])
    magnitude = estimate.magnitude_rps
    spin = f"{magnitude:.0f} rps ({rpm(magnitude):.0f} rpm)"
    if kind.parts_rps:
        named = [f"{kind.name.capitalize()} {spin}", *speed, f"axis {kind.off_deg:.0f} degrees off pure {kind.name}"]
    else:
        named = [f"Spin {spin}", *speed, f"{kind.name}, {kind.off_deg:.0f} degrees off"]
    std = estimate.magnitude_std_rps
    # A coach does not read hundredths: a tenth at least.
    margin = [] if std is None else [f"±{max(std, 0.1):.1f} rps" if std < 1 else f"±{std:.0f} rps"]
    return ", ".join([*named, *margin])


def _estimate(session: Session, shot: Shot, estimate: SpinEstimate) -> dict[str, Any]:
    truth = session.truth
    error = shot.error_against(truth, estimate.method) if truth is not None and truth.t_us.size else None
    axis = estimate.axis
    return {
        "status": estimate.status,
        "reason": estimate.reason,
        "magnitude_rps": _finite(estimate.magnitude_rps),
        "magnitude_std_rps": _finite(estimate.magnitude_std_rps),
        "axis": None if axis is None else axis.tolist(),
        "axis_std_deg": _finite(estimate.axis_std_deg),
        "error_rps": _finite(error[0]) if error else None,
        "error_deg": _finite(error[1]) if error else None,
        "error_share": _error_share(session, shot, estimate) if error else None,
    }


def _error_share(session: Session, shot: Shot, estimate: SpinEstimate) -> float | None:
    """|spin - truth| / |truth| at the shot's middle; None without an answer or a true spin."""
    truth = session.truth
    if truth is None or estimate.vector_rps is None:
        return None
    middle_us = (shot.start_us + shot.end_us) / 2
    spin = np.array([np.interp(middle_us, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
    size = float(np.linalg.norm(spin))
    return float(np.linalg.norm(estimate.vector_rps - spin)) / size if size > 0 else None


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None
