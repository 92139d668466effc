"""The pixels' latency, lag and outline, from tracked recordings whose truth is known."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError
from ..results import Truth
from .track import TrackParameters, TrackResult

# The speeds must differ by this factor before latency and lag can be told apart.
SPEED_RATIO = 1.5


@dataclass(frozen=True, slots=True)
class EdgeCalibration:
    """What fits best, as the fields of TrackParameters of the same names, and what is left over.

    along_std_px, radius_std_px : scatter of what remains, along the motion and of the radius
    outlines : number of outlines behind it
    """

    latency_us: float
    lag_px: float
    outline_px: float
    along_std_px: float
    radius_std_px: float
    outlines: int


def calibrate_latency(
    runs: Iterable[tuple[TrackParameters, Sequence[TrackResult], Truth]], width_px: int, height_px: int
) -> EdgeCalibration:
    """Compare tracked outlines with the truth: they lie lag + latency x speed behind the ball.

    runs : one a recording: the parameters it was tracked with, the results, the truth
    Uses every measured tick with the ball wholly in view. Where all balls are about equally fast the lag is kept
    as it was and only the latency fitted.

    Raises ParameterError when fewer than ten outlines can be used.
    """
    rows = []
    for parameters, results, truth in runs:
        for result in results:
            circle, speed = result.measured, float(np.hypot(*result.mean[2:4]))
            end_us = result.t_us + result.latency_us
            if circle is None or not (truth.t_us[0] <= end_us <= truth.t_us[-1]):
                continue
            x, y, radius = (
                float(np.interp(end_us, truth.t_us, column)) for column in (truth.x_px, truth.y_px, truth.radius_px)
            )
            off_x, off_y = circle.x_px - x, circle.y_px - y
            inside = radius < x < width_px - 1 - radius and radius < y < height_px - 1 - radius
            if not inside or np.hypot(off_x, off_y) > radius:
                continue
            behind = parameters.lag_px - (off_x * result.mean[2] + off_y * result.mean[3]) / speed
            rows.append((speed, behind, circle.radius_px + parameters.outline_px - radius, parameters.lag_px))
    if len(rows) < 10:
        raise ParameterError(f"{len(rows)} outlines of tracked balls are too few to calibrate: 10 or more are needed")
    speed_px_s, behind_px, outline_px, lag_px = np.array(rows).T
    lag = float(np.median(lag_px))
    if speed_px_s.max() > SPEED_RATIO * speed_px_s.min():
        latency_s, lag = np.polyfit(speed_px_s, behind_px, 1).tolist()
    else:
        latency_s = float(np.median((behind_px - lag) / speed_px_s))
    left = behind_px - lag - latency_s * speed_px_s
    return EdgeCalibration(
        latency_s * 1e6, lag, float(np.median(outline_px)), float(left.std()), float(outline_px.std()), len(rows)
    )
