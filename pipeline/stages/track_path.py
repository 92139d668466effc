"""A ball's path: its measured circles tick by tick, and the path in space with a hinge at a contact through them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..results import Circle

Floats = NDArray[np.float64]

# Errors of the outline's edge ahead and of the circle's radius from tick to tick on clean scenes, where 0.2 px of the
# radius are bias that changes with the ball's motion.
CLEAN_EDGE_STD_PX, CLEAN_RADIUS_STD_PX = 0.03, 0.25
# And of a circle whose events are from both sides of a contact: a bounce jumps by 100 to 500 px/s, for up to 3 ms.
STRADDLING_STD_PX = 0.3
GRAVITY_M_S2 = 9.81
# Largest accelerations by drag and by lift, over speed squared (203 measured flights: drag coefficient 0.16 / m, lift
# coefficient up to 0.26). Double their sum is the 1 sigma of what a flight's acceleration may be.
DRAG_1_M, LIFT_1_M = 0.16, 0.07
# 1 sigma of the jump of velocity at a contact: a smash gives 30 m/s.
JUMP_M_S = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class PathPoint:
    """One tick of a ball's path.

    Attributes
    ----------
    end_us : int
        The tick's end.
    circle : Circle, optional
        The measured circle, None if none was.
    noise : (3, 3) float64
        Covariance of its x, y and radius, px^2.
    shake_px : float
        1 sigma by which a shaking camera, or a print that turns at the rim, moved it across the view, on either axis.
    """

    end_us: int
    circle: Circle | None
    noise: Floats
    shake_px: float = 0.0


def independent_points(path: list[PathPoint], span_us: int, apart_us: int) -> list[PathPoint]:
    """The points of the path's last span_us with circles at least apart_us apart, oldest first."""
    points: list[PathPoint] = []
    for point in reversed(path):
        if point.end_us <= path[-1].end_us - span_us:
            break
        if point.circle is not None and (not points or points[-1].end_us - point.end_us >= apart_us):
            points.append(point)
    return points[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """A ball's measured places in space.

    Attributes
    ----------
    times_us : (n,) float64
        When it was there.
    centres_m, weights : (n, 3) float64, (n, 3, 3) float64
        Its centres, camera frame, and the inverses of their covariances.
    precisions : (6,) float64
        One over the variances of a path's coefficients: what flight and contacts allow.
    """

    times_us: Floats
    centres_m: Floats
    weights: Floats
    precisions: Floats

    @classmethod
    def of(
        cls, points: list[PathPoint], straddling_us: tuple[float, float], camera: Camera, ball_radius_m: float
    ) -> Places:
        """The places of points with circles; those that end in the given span have events of both sides of a contact.

        straddling_us is the first and last end of those.
        """
        times_us = np.array([point.end_us for point in points], np.float64)
        circles = np.array([[c.x_px, c.y_px, c.radius_px] for point in points if (c := point.circle)])
        shakes_px = np.array([point.shake_px for point in points])
        centres_m, weights = _located(circles, shakes_px, camera, ball_radius_m)
        straddles = (times_us >= straddling_us[0]) & (times_us < straddling_us[1])
        weights[straddles] *= (CLEAN_EDGE_STD_PX / STRADDLING_STD_PX) ** 2
        span_s = (times_us[-1] - times_us[0]) * 1e-6
        speed_m_s = float(np.linalg.norm(np.diff(centres_m, axis=0)[:, :2], axis=1).sum()) / span_s
        lift_m_s2, drag_m_s2 = LIFT_1_M * speed_m_s**2, DRAG_1_M * speed_m_s**2
        jerk_m_s3 = 2.0 * DRAG_1_M * speed_m_s * (drag_m_s2 + lift_m_s2 + GRAVITY_M_S2)
        acceleration_m_s2 = GRAVITY_M_S2 + lift_m_s2 + drag_m_s2
        largest = np.array([1e3, 1e3, acceleration_m_s2 / 2, jerk_m_s3 / 6, JUMP_M_S, (1.0 + lift_m_s2) / 2])
        return cls(times_us, centres_m, weights, largest**-2.0)

    def equations(self, hinges_us: Floats) -> tuple[Floats, Floats]:
        """Normal matrices (m, 18, 18) and right sides (m, 18) of the paths with a hinge at these times (m,)."""
        terms = _terms(self.times_us, hinges_us[:, None])
        products = (terms[..., :, None] * terms[..., None, :]).reshape(*terms.shape[:2], 36)
        normals = np.swapaxes(products, 1, 2) @ self.weights.reshape(-1, 9)
        normals = normals.reshape(-1, 6, 6, 3, 3).swapaxes(2, 3).reshape(-1, 18, 18)
        weighted = (self.weights @ self.centres_m[:, :, None])[..., 0]
        return normals + np.diag(np.repeat(self.precisions, 3)), (np.swapaxes(terms, 1, 2) @ weighted).reshape(-1, 18)

    def costs(self, hinges_us: Floats) -> Floats:
        """Squared distances (m,), in sigma, of the places from the best paths with a hinge at these times (m,)."""
        normals, moments = self.equations(hinges_us)
        explained = np.sum(moments * np.linalg.solve(normals, moments[..., None])[..., 0], axis=1)
        costs: Floats = np.einsum("na,nab,nb->", self.centres_m, self.weights, self.centres_m) - explained
        return costs


def _terms(times_us: Floats, hinge_us: float | Floats) -> Floats:
    s = (times_us - hinge_us) * 1e-6
    after = np.maximum(s, 0.0)
    return np.stack([s**0, s, s**2, s**3, after, after**2], axis=-1)


class HingedPath:
    """A ball's path in space, a cubic in time with a hinge, fitted to its measured places.

    In space, as perspective bends the path in the image when a contact turns the speed towards the camera.

    Parameters
    ----------
    places : Places
        The places.
    hinge_us : float
        Time of the hinge.

    Attributes
    ----------
    roughness : float
        Variance of the places about it over that on clean scenes, 1 at least.
    unsure_m_s : (3,) float64
        2 sigma of the jump of velocity along its least known direction.
    """

    def __init__(self, places: Places, hinge_us: float, camera: Camera, ball_radius_m: float) -> None:
        self.hinge_us = hinge_us
        self._camera, self._ball_radius_m = camera, ball_radius_m
        normals, moments = places.equations(np.array([hinge_us]))
        spread = np.linalg.inv(normals[0])
        self._coefficients = (spread @ moments[0]).reshape(6, 3)
        cost = float(places.costs(np.array([hinge_us]))[0])
        self.roughness = max(1.0, cost / max(1, 3 * places.times_us.size - 12))
        variances, directions = np.linalg.eigh(self.roughness * spread[12:15, 12:15])
        self.unsure_m_s: Floats = 2.0 * math.sqrt(variances[-1]) * directions[:, -1]

    def velocity_m_s(self, time_us: float) -> Floats:
        """(3,) float64 velocity in m/s, camera frame."""
        s = (time_us - self.hinge_us) * 1e-6
        after = float(s >= 0.0)
        velocity: Floats = np.array([0.0, 1.0, 2 * s, 3 * s**2, after, 2 * after * s]) @ self._coefficients
        return velocity

    def state(self, time_us: float) -> Floats:
        """(5,) float64 [x_px, y_px, vx_px_s, vy_px_s, radius_px] of the ball in the image."""
        centres_m = _terms(np.array([time_us, time_us + 1.0]), self.hinge_us) @ self._coefficients
        x, y, radius = self._camera.silhouette(centres_m, self._ball_radius_m)
        return np.array([x[0], y[0], (x[1] - x[0]) * 1e6, (y[1] - y[0]) * 1e6, radius[0]])


def _located(circles: Floats, shakes_px: Floats, camera: Camera, ball_radius_m: float) -> tuple[Floats, Floats]:
    """Centres (n, 3) of balls in m, camera frame, and the inverses (n, 3, 3) of their covariances."""
    steps = circles[-1, :2] - circles[0, :2]
    ux, uy = steps / (math.hypot(*steps) or 1.0)
    # Errors of the edge ahead, of the place across the flight, and of the radius, which the centre makes up for.
    edges, size = np.hypot(CLEAN_EDGE_STD_PX, shakes_px)[:, None], CLEAN_RADIUS_STD_PX
    modes_px = np.zeros((len(circles), 4, 3))
    modes_px[:, 1, :2], modes_px[:, 2, :2] = edges * [ux, uy], edges * [-uy, ux]
    modes_px[:, 3] = -size * ux, -size * uy, size
    changed = (circles[:, None] + modes_px).reshape(-1, 3)
    centres_m = camera.ball_centre_m(changed[:, 0], changed[:, 1], changed[:, 2], ball_radius_m).reshape(-1, 4, 3)
    errors_m = centres_m[:, 1:] - centres_m[:, :1]
    return centres_m[:, 0], np.asarray(np.linalg.inv(np.swapaxes(errors_m, 1, 2) @ errors_m))
