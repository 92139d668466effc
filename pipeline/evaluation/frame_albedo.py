"""The ball in a frame: its circle, and the relative albedo of its visible side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .frame_camera import Frame, pixel_rays, sphere_along

Floats = NDArray[np.float64]

CONTRAST = 0.1  # between ball and table, at least; half of what the ball's rim has
SEEN_COSINE = 0.45  # albedo is read up to 63 degrees from the middle of the disc


@dataclass(frozen=True, eq=False)
class SurfaceAlbedo:
    """Albedo of the visible side of the ball in one frame."""

    t_s: float  # middle of the exposure
    normals: Floats  # (n, 3) outward, of the surface points, camera frame
    darkening: Floats  # (n,) 1 - albedo / albedo of the unprinted ball, 0 to 1


def surface_albedos(seen: Sequence[Frame], camera: Camera, radius_m: float) -> list[SurfaceAlbedo]:
    """The albedo in every frame, the circles of the ball being smoothed over the flight; none from under 3 frames."""
    circles = [(frame, circle) for frame in seen if (circle := _circle(frame)) is not None]
    if len(circles) < 3:
        return []
    time = np.array([frame.t_s for frame, _ in circles])
    x, y, radius = np.array([circle for _, circle in circles]).T
    x, y = (np.polynomial.Polynomial.fit(time, place, min(3, time.size - 1))(time) for place in (x, y))
    radius = np.polynomial.Polynomial.fit(time, radius, 1)(time)
    centres = camera.ball_centre_m(x, y, radius, radius_m)
    return [
        _surface_albedo(frame, centre, camera, radius_m) for (frame, _), centre in zip(circles, centres, strict=True)
    ]


def _circle(frame: Frame) -> tuple[float, float, float] | None:
    """(x, y, radius) in px of the ball, from what differs from the background; None when nothing does.

    Motion draws the disc out to a stadium: its middle is the centre, its width twice the radius.
    """
    finer = 4
    change = np.abs(frame.image - frame.background).astype(np.float32)
    large = cv2.resize(change, None, fx=finer, fy=finer, interpolation=cv2.INTER_LINEAR)
    outlines, _ = cv2.findContours((large > CONTRAST).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return None
    hull = cv2.convexHull(max(outlines, key=cv2.contourArea))
    if len(hull) < 5:
        return None
    moments = cv2.moments(hull)
    (_, sides, _) = cv2.minAreaRect(hull)
    x, y = ((moments[m] / moments["m00"] + 0.5) / finer - 0.5 for m in ("m10", "m01"))
    return frame.x0_px + x, frame.y0_px + y, (min(sides) + 1) / 2 / finer


def _surface_albedo(frame: Frame, centre_m: Floats, camera: Camera, radius_m: float) -> SurfaceAlbedo:
    """Albedo from one frame: the ball's brightness over its shading, which a smooth fit gives."""
    rays = pixel_rays(camera, frame.x0_px, frame.y0_px, frame.image.shape[0])
    _, inside, normals = sphere_along(rays, centre_m, radius_m)
    cosine = -(normals @ centre_m) / np.linalg.norm(centre_m)
    on_ball = (inside > 0) & (cosine > SEEN_COSINE)
    light = frame.image.ravel()
    shading = np.column_stack([np.ones(light.size), normals])
    bright = on_ball.copy()
    plain = light
    for _ in range(4):  # what is darker than the shading is printed and leaves the fit
        weights, *_ = np.linalg.lstsq(shading[bright], light[bright], rcond=None)
        plain = np.maximum(shading @ weights, 0.05)
        bright = on_ball & (light > 0.9 * plain)
        if bright.sum() < 10:
            bright = on_ball
    return SurfaceAlbedo(frame.t_s, normals[on_ball], np.clip(1 - light / plain, 0.0, 1.0)[on_ball])
