"""Metrics of a run: the numbers that tables, parameter sweeps and the optimization compare."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .flight_calibration import measured_up
from .results import SpinEstimate
from .session import Result, Session
from .shots import Shot
from .spin.combined.result import Witness
from .spin.combined.stage import LABELS
from .spin_terms import Kind, kind_of_spin, km_h, rpm
from .tick import Tick

Floats = NDArray[np.float64]


def _metric(label: str, unit: str = "", help: str = "") -> Any:
    """Declare a metric that is shown: its label, unit (% for a share of 0 to 1) and explanation."""
    return dataclasses.field(metadata={"label": label, "unit": unit, "help": help})


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateMetrics:
    """Estimate of one method for one shot, ready for JSON; None for what is not known.

    Attributes
    ----------
    error_rps, error_deg : float or None
        Errors of magnitude and signed axis against the simulator's truth.
    error_share : float or None
        |spin - truth| / |truth| at the middle of the shot.
    """

    status: str
    reason: str | None
    magnitude_rps: float | None = _metric("Spin", "rps", "Magnitude of the spin.")
    magnitude_std_rps: float | None
    axis: list[float] | None
    axis_std_deg: float | None = _metric("1σ of the axis", "°", "Stated error of the axis, both directions together.")
    error_rps: float | None = _metric("Error against truth", "rps", "Magnitude less the true one, absolute.")
    error_deg: float | None = _metric("Axis error against truth", "°", "Angle between the signed axes, 0 to 180°.")
    error_share: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessMetrics:
    """Evidence of one witness of the combined answer; None for what it does not tell.

    Attributes
    ----------
    odds : str
        For or against the combined spin, in words; empty where they are nearly even.
    """

    magnitude_rps: float | None
    magnitude_std_rps: float | None
    odds: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotMetrics:
    """One shot with the estimate of every method.

    Attributes
    ----------
    best : str or None
        Trusted method.
    best_reason : str or None
        Why no method is trusted.
    kind : str or None
        Kind of the trusted spin, like "topspin".
    sentence : str
        Spin, speed and kind in one sentence for a coach.
    witnesses : dict of str to WitnessMetrics
        Those of the combined answer, by their names for people.
    """

    start_us: int
    end_us: int
    logo_events: int
    speed_m_s: float | None = _metric("Speed", "m/s", "Mean speed of the ball over the shot.")
    radius_px: float | None = _metric("Radius", "px", "Median radius of the ball over the shot.")
    best: str | None
    best_reason: str | None
    kind: str | None
    sentence: str
    spin: dict[str, EstimateMetrics]
    witnesses: dict[str, WitnessMetrics]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMetrics:
    """Metrics of a run over all its shots.

    Attributes
    ----------
    tracked_share : float or None
        Share of the ticks in which a circle was measured; None for a fixed ball, whose circle is given.
    residual_px : float or None
        RMS distance of the measured circles from the filter's, centre and radius together.
    jitter_px : float or None
        1 sigma of the noise of the measured centres along one axis, from their second differences.
    logo_events : int
        Logo events of all shots.
    up_doubt : str or None
        In which direction the balls fall, where that is not the one of camera.up.
    """

    ticks: int
    tracked_share: float | None = _metric("Ticks tracked", "%", "Share of the ticks in which a circle was measured.")
    residual_px: float | None = _metric(
        "Residual of the circle",
        "px",
        "RMS distance of the measured circles from the Kalman filter's, centre and radius.",
    )
    jitter_px: float | None = _metric(
        "Track jitter", "px", "1 sigma of the measured centres along one axis, from their second differences."
    )
    logo_events: int = _metric(
        "Logo events", help="Events inside the ball less the pad, of all shots: the evidence of the spin."
    )
    shots: list[ShotMetrics]
    no_shot_reason: str | None
    up_doubt: str | None

    @classmethod
    def of(cls, result: Result) -> RunMetrics:
        """Metrics of a result with all its ticks, of which the track and the logo are needed."""
        session, ticks, up = result.session, result.ticks, measured_up(result)
        return cls(
            ticks=len(ticks),
            tracked_share=None if session.parameters.track.ball == "fixed" else _measured_share(ticks),
            residual_px=_residual_px(ticks),
            jitter_px=_jitter_px(ticks),
            logo_events=sum(len(tick.logo.events) for tick in ticks),
            shots=[_shot(session, shot) for shot in result.shots],
            no_shot_reason=result.no_shot_reason,
            up_doubt=None if up is None else up.warning(is_stated=True),
        )

    @property
    def main_shot(self) -> ShotMetrics | None:
        """Shot with the most logo events; None when there is none."""
        return max(self.shots, key=lambda shot: shot.logo_events, default=None)


def _measured_share(ticks: Sequence[Tick]) -> float:
    return sum(tick.track.measured is not None for tick in ticks) / max(len(ticks), 1)


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


def _shot(session: Session, shot: Shot) -> ShotMetrics:
    velocity = (
        None if session.parameters.track.ball == "fixed" else shot.velocity_m_s(session.camera, session.ball_radius_m)
    )
    trusted = shot.estimates[shot.best] if shot.best is not None else None
    kind = None
    if trusted is not None and trusted.vector_rps is not None:
        kind = kind_of_spin(trusted.vector_rps, velocity, session.camera.up)
    return ShotMetrics(
        start_us=shot.start_us,
        end_us=shot.end_us,
        logo_events=shot.logo_events or 0,
        speed_m_s=None if velocity is None else _finite(float(np.linalg.norm(velocity))),
        radius_px=_finite(float(np.median(shot.state[:, 4]))) if len(shot.state) else None,
        best=shot.best,
        best_reason=shot.best_reason,
        kind=kind.name if kind else None,
        sentence=coach_sentence(trusted, kind, velocity),
        spin={name: _estimate(session, shot, estimate) for name, estimate in shot.estimates.items()},
        witnesses={} if shot.combined is None else {LABELS[one.name]: _witness(one) for one in shot.combined.witnesses},
    )


def _witness(witness: Witness) -> WitnessMetrics:
    return WitnessMetrics(
        magnitude_rps=_finite(witness.magnitude_rps),
        magnitude_std_rps=_finite(witness.magnitude_std_rps),
        odds=witness.odds,
    )


def coach_sentence(estimate: SpinEstimate | None, kind: Kind | None, velocity_m_s: Floats | None) -> str:
    """Describe a shot: `Topspin 54 ± 2 rps (3240 rpm), 32 km/h, axis tilted 12° from pure topspin`."""
    speed = [] if velocity_m_s is None else [f"{km_h(float(np.linalg.norm(velocity_m_s))):.0f} km/h"]
    if estimate is None or kind is None or estimate.magnitude_rps is None:
        return ", ".join(["Spin not known", *speed])
    magnitude, std = estimate.magnitude_rps, estimate.magnitude_std_rps
    # A coach does not read hundredths: a tenth at least, and no finer than it is known.
    digits = 1 if std is not None and std < 1 else 0
    margin = "" if std is None else f" ± {max(std, 0.1):.{digits}f}"
    spin = f"{magnitude:.{digits}f}{margin} rps ({rpm(magnitude):.0f} rpm)"
    if kind.parts_rps:
        return ", ".join(
            [f"{kind.name.capitalize()} {spin}", *speed, f"axis tilted {kind.off_deg:.0f}° from pure {kind.name}"]
        )
    return ", ".join([f"Spin {spin}", *speed, f"{kind.name}, tilted by {kind.off_deg:.0f}°"])


def _estimate(session: Session, shot: Shot, estimate: SpinEstimate) -> EstimateMetrics:
    truth = session.truth
    error = shot.error_against(truth, estimate.method) if truth is not None and truth.t_us.size else None
    axis = estimate.axis
    return EstimateMetrics(
        status=estimate.status,
        reason=estimate.reason,
        magnitude_rps=_finite(estimate.magnitude_rps),
        magnitude_std_rps=_finite(estimate.magnitude_std_rps),
        axis=None if axis is None else axis.tolist(),
        axis_std_deg=_finite(estimate.axis_std_deg),
        error_rps=_finite(error[0]) if error else None,
        error_deg=_finite(error[1]) if error else None,
        error_share=_error_share(session, shot, estimate) if error else None,
    )


def _error_share(session: Session, shot: Shot, estimate: SpinEstimate) -> float | None:
    truth = session.truth
    if truth is None or estimate.vector_rps is None:
        return None
    middle_us = (shot.start_us + shot.end_us) / 2
    spin = np.array([np.interp(middle_us, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
    size = float(np.linalg.norm(spin))
    return float(np.linalg.norm(estimate.vector_rps - spin)) / size if size > 0 else None


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None
