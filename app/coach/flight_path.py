"""The flight of a shot over the table, or in the hitter's frame where nobody knows where the camera is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Of the laws of table tennis (ITTF 2.1, 2.2), metres.
TABLE_LENGTH_M, TABLE_WIDTH_M, NET_HEIGHT_M = 2.74, 1.525, 0.1525
BALL_RADIUS_M = 0.020
DRAWN_POINTS = 40
FEWEST = 4  # circles of a parabola


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPath:
    """The smoothed flight, metres.

    Attributes
    ----------
    frame : str
        `table`: x along the table with the flight, y to the left, z up, from the middle of the net's line on the table;
        `hitter`: the same directions from the first point, of which nothing says where it is.
    t_us : list of float
        Rising.
    points_m : list of (x, y, z)
        Centres of the ball.
    net_clearance_m : float, optional
        Height of the ball's lowest point over the net; None where it did not cross it in view.
    height_std_m : float, optional
        1 sigma of all heights together: the distance from the camera follows from the radius of the outline, which is
        seen some tenths of a pixel outside the ball.
    landing_m : (x, y), optional
        Where it bounced; None where that was not seen.
    """

    frame: Literal["table", "hitter"]
    t_us: list[float]
    points_m: list[tuple[float, float, float]]
    net_clearance_m: float | None
    height_std_m: float | None
    landing_m: tuple[float, float] | None


def flight_path(
    shot: Mapping[str, Any], detail: Mapping[str, Any], pose: Mapping[str, Any] | None
) -> FlightPath | None:
    """The flight of a shot; None where it is too short or does not fly level.

    Parameters
    ----------
    shot, detail : mapping
        Row of a session and its `shot_detail`.
    pose : mapping, optional
        As `mark_table` keeps it: `axes`, rows of the table's frame (along, left, up) in that of the camera, and
        `camera_m`, the camera's place in it.

    Notes
    -----
    Each coordinate is a parabola in time: gravity, drag and lift hardly change within the tenth of a second in view,
    and the depth, known to 1 % from the radius, is smoothed with it.
    """
    path = detail["path"]
    t_us = np.array(path["t_us"], np.float64)
    if len(t_us) < FEWEST or detail["hitter"] is None:
        return None
    places = np.stack([path["x_m"], path["y_m"], path["z_m"]], axis=1)
    if pose is not None:
        axes = np.array(pose["axes"], np.float64)
        points, frame, upward = places @ axes.T + pose["camera_m"], "table", axes[2]
        if points[-1, 0] < points[0, 0]:
            points[:, :2] *= -1  # the table seen from the hitter's end
    else:
        right, up, forward = np.array(detail["hitter"])
        points, frame = (places - places[0]) @ np.stack([forward, -right, up], axis=1), "hitter"
        upward = up
    middle_us = t_us.mean()
    curve = np.polynomial.polynomial.polyfit((t_us - middle_us) * 1e-6, points, 2)

    def at(times_us: Floats) -> Floats:
        found: Floats = np.polynomial.polynomial.polyval((times_us - middle_us) * 1e-6, curve).T
        return found

    drawn_us = np.linspace(max(shot["start_us"], t_us[0]), min(shot["end_us"], t_us[-1]), DRAWN_POINTS)
    drawn = at(drawn_us)
    depth_std_m = detail.get("depth_std_m")  # early sessions have none
    height_std_m = None if depth_std_m is None else abs(float(upward @ np.array(detail["line_of_sight"]))) * depth_std_m
    clearance = landing = None
    if frame == "table":
        ahead = drawn[:, 0]
        if ahead[0] <= 0 <= ahead[-1] and height_std_m is not None:
            crossed = at(np.interp([0.0], ahead, drawn_us))[0]
            clearance = float(crossed[2] - BALL_RADIUS_M - NET_HEIGHT_M)
        if shot["ended_by"] == "bounce":
            x_m, y_m, _ = at(np.array([shot["end_us"]], np.float64))[0]
            landing = (float(x_m), float(y_m))
    points_m = [(float(x), float(y), float(z)) for x, y, z in drawn]
    return FlightPath(
        frame="table" if frame == "table" else "hitter",
        t_us=drawn_us.tolist(),
        points_m=points_m,
        net_clearance_m=clearance,
        height_std_m=height_std_m,
        landing_m=landing,
    )
