"""The camera and the ball: from pixels to rays, and from a silhouette to a place in space and back.

Camera frame: right-handed, x right, y down, z away from the camera into the scene; metres. A pixel's origin is
the centre of the top-left pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .compilation import njit
from .errors import ParameterError
from .parameters import ParameterGroup, tunable

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CameraParameters(ParameterGroup):
    """Optics and pose; the defaults are the paper's camera (section 4.1: EVK4 with an 8 mm lens, looking down)."""

    focal_length_mm: float = tunable(8.0, 0.5, 1000.0, 0.1, "mm", "focal length of the lens")
    pixel_um: float = tunable(4.86, 0.5, 100.0, 0.01, "um", "pitch of the pixels (IMX636: 4.86 um)")
    principal_x_px: float | None = tunable(
        None, -10000.0, 10000.0, 0.5, "px", "column of the principal point; auto = middle of the image"
    )
    principal_y_px: float | None = tunable(
        None, -10000.0, 10000.0, 0.5, "px", "row of the principal point; auto = middle of the image"
    )
    distortion: tuple[float, ...] = tunable(
        (0.0, 0.0, 0.0, 0.0, 0.0), -100.0, 100.0, 0.01, "", "OpenCV's lens distortion k1, k2, p1, p2, k3"
    )
    up: tuple[float, ...] = tunable(
        (0.0, 0.0, -1.0), -1.0, 1.0, 0.1, "", "up in the camera frame; (0, 0, -1) for a camera that looks down"
    )


@dataclass(frozen=True, kw_only=True)
class BallParameters(ParameterGroup):
    """The ball."""

    diameter_mm: float = tunable(40.0, 1.0, 1000.0, 0.5, "mm", "diameter of the ball (table tennis: 40 mm)")


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera with lens distortion, in pixels."""

    width_px: int
    height_px: int
    focal_px: float
    principal_x_px: float
    principal_y_px: float
    distortion: tuple[float, ...]
    up: tuple[float, ...]

    @classmethod
    def of(cls, parameters: CameraParameters, width_px: int, height_px: int) -> Camera:
        """The camera of these parameters on a sensor of this size; raises ParameterError for up = 0."""
        length = float(np.linalg.norm(parameters.up))
        if length < 1e-6:
            raise ParameterError("camera.up = 0,0,0 is no direction: (0, 0, -1) is up for a camera that looks down")
        x, y = parameters.principal_x_px, parameters.principal_y_px
        principal = (width_px - 1) / 2 if x is None else x, (height_px - 1) / 2 if y is None else y
        focal_px = parameters.focal_length_mm * 1000.0 / parameters.pixel_um
        up = tuple(float(u) / length for u in parameters.up)
        return cls(width_px, height_px, focal_px, *principal, parameters.distortion, up)

    def rays(self, x_px: ArrayLike, y_px: ArrayLike) -> Floats:
        """(n, 3) float64 directions of the camera rays through these pixels, with z = 1, distortion undone."""
        x = (np.atleast_1d(x_px) - self.principal_x_px) / self.focal_px
        y = (np.atleast_1d(y_px) - self.principal_y_px) / self.focal_px
        if any(self.distortion) and x.size:
            import cv2  # only needed for real lenses; 60 ms to load

            points = cv2.undistortPoints(
                np.stack([x, y], axis=1).reshape(-1, 1, 2), np.eye(3), np.array(self.distortion)
            ).reshape(-1, 2)
            x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
        directions = np.ones((x.size, 3))
        directions[:, 0], directions[:, 1] = x, y
        return directions

    def project(self, points_m: ArrayLike) -> Floats:
        """(n, 2) float64 pixels of points (n, 3) in the camera frame, in front of the camera."""
        points = np.atleast_2d(np.asarray(points_m, np.float64))
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        if any(self.distortion):
            k1, k2, p1, p2, k3 = self.distortion
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x, y = (
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            )
        return np.stack([x * self.focal_px + self.principal_x_px, y * self.focal_px + self.principal_y_px], axis=1)

    def ball_centre_m(self, x_px: ArrayLike, y_px: ArrayLike, radius_px: ArrayLike, ball_radius_m: float) -> Floats:
        """(n, 3) float64 centres of balls whose silhouettes have these centres and radii; inverse of `silhouette`.

        The outline of a sphere is the cone of half-angle alpha = asin(R / distance) around the direction theta off
        the optical axis. It cuts the image plane (focal length 1) in an ellipse with its centre at
        rho = sin(theta) cos(theta) / q and semi-axes sin(alpha) cos(alpha) / q and b = sin(alpha) / sqrt(q), where
        q = cos(theta)^2 - sin(alpha)^2. Without the angles, for u = b^2 and the radius g = geometric mean of the
        axes: u^3 + (1 + rho^2) u^2 = g^4 (1 + u), solved by Newton's method from the value for small balls, and
        z = R sqrt((1 + u) / u), x / z = (x of the ellipse's centre) / (1 + u).
        """
        centre = self.rays(x_px, y_px)
        _set_in_space(centre, np.atleast_1d(np.asarray(radius_px, np.float64)) / self.focal_px, ball_radius_m)
        return centre

    def silhouette(self, centre_m: ArrayLike, ball_radius_m: float) -> tuple[Floats, Floats, Floats]:
        """(n,) x_px, y_px and radius_px of the outlines of balls at centre_m (n, 3); see `ball_centre_m`.

        A ball beside the camera, where q is not positive, has no ellipse for an outline: its radius is NaN.
        """
        centre = np.atleast_2d(np.asarray(centre_m, np.float64))
        across2, distance2 = centre[:, 0] ** 2 + centre[:, 1] ** 2, np.sum(centre**2, axis=1)
        sin2_alpha = ball_radius_m**2 / distance2
        cos2_theta = 1 - across2 / distance2
        q = cos2_theta - sin2_alpha
        size = np.sqrt(sin2_alpha * np.sqrt(1 - sin2_alpha) / np.where(q > 0, q, np.nan) ** 1.5)
        stretch = cos2_theta / q  # how much farther out the ellipse's centre is than the centre's own image
        x_px, y_px = self.project(centre * np.stack([stretch, stretch, np.ones_like(q)], axis=1)).T
        return x_px, y_px, size * self.focal_px


@njit(cache=True)
def _set_in_space(rays: Floats, sizes: Floats, ball_radius_m: float) -> None:
    """Turn rays (n, 3) with z = 1 into centres; sizes (n,): radii for focal length 1. See `Camera.ball_centre_m`."""
    for i in range(rays.shape[0]):
        x, y, g4 = rays[i, 0], rays[i, 1], sizes[i] ** 4
        wide = 1 + x * x + y * y
        u = math.sqrt(g4 / wide)
        for _ in range(4):  # from a relative error of u on: u^2, u^4, u^8, u^16
            u -= ((u + wide) * u * u - g4 * (1 + u)) / ((3 * u + 2 * wide) * u - g4)
        z_m = ball_radius_m * math.sqrt((1 + u) / u)
        rays[i, 0], rays[i, 1], rays[i, 2] = x / (1 + u) * z_m, y / (1 + u) * z_m, z_m
