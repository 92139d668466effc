"""Parameters of the tracker."""

from __future__ import annotations

from dataclasses import dataclass

from ..parameters import ParameterGroup, choice, tunable


@dataclass(frozen=True, kw_only=True)
class TrackParameters(ParameterGroup):
    """The tick, the search for the circle, and the Kalman filter."""

    ball: str = choice("flying", ("flying", "fixed"), "flying ball, or a ball spinner's ball that stays in place")
    tick_us: int = tunable(5000, 200, 100_000, 100, "us", "time between two steps of the pipeline (200 Hz)")
    radius_min_px: float | None = tunable(
        None, 2.0, 500.0, 0.5, "px", "smallest radius looked for; auto = a ball 6 m away"
    )
    radius_max_px: float | None = tunable(
        None, 3.0, 500.0, 0.5, "px", "largest radius looked for; auto = a ball 0.3 m away"
    )
    speed_min_m_s: float = tunable(1.0, 0.0, 100.0, 0.1, "m/s", "slowest ball that counts as a shot")
    speed_max_m_s: float = tunable(25.0, 1.0, 200.0, 1.0, "m/s", "fastest ball looked for")
    latency_us: float = tunable(40.0, 0.0, 10_000.0, 5.0, "us", "how late the pixels report an edge")
    lag_px: float = tunable(0.1, -2.0, 5.0, 0.05, "px", "how far the outline seems behind, at any speed")
    outline_px: float = tunable(
        0.5, 0.0, 5.0, 0.05, "px", "how far outside the ball the pixels see its edge; 0 = circle of the events ahead"
    )
    contour_us: int = tunable(3000, 500, 50_000, 100, "us", "how far back in time the outline's events are taken")
    acceleration_m_s2: float = tunable(15.0, 0.1, 1000.0, 1.0, "m/s^2", "Kalman: 1 sigma of the acceleration")
    approach_m_s: float = tunable(3.0, 0.1, 100.0, 0.5, "m/s", "Kalman: 1 sigma of the speed towards the camera")
    shake_px: float = tunable(
        0.4, 0.0, 20.0, 0.1, "px", "1 sigma by which a shaking camera moves the ball while most of the background moves"
    )
    coast_us: int = tunable(20_000, 0, 1_000_000, 1000, "us", "how long an unseen ball is kept")
    fixed_x_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: column of the centre")
    fixed_y_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: row of the centre")
    fixed_radius_px: float | None = tunable(None, 1.0, 1000.0, 0.1, "px", "fixed ball: radius")
    fixed_std_px: float = tunable(0.5, 0.0, 100.0, 0.1, "px", "fixed ball: 1 sigma of centre and radius")
