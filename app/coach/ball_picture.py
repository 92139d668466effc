"""Picture of a shot's ball with its own logo and the axis of its spin, painted without a screen."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.rotation import rotations

from .logo_texture import octahedral_directions, octahedral_pixels

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

GROUND, WHITE, INK, AXIS = ((247, 248, 250), (252, 250, 244), (34, 48, 110), (214, 81, 8))  # RGB
BALL_SHARE = 0.7  # of the picture's half side: the axis stands out of the ball
AXIS_LENGTH, AXIS_WIDTH = 1.4, 0.045  # in ball radii
FINER = 3
SMOOTH = 4  # a texture's pixel is 6 of a ball of 400 px: no wider than 2 are left
PHASES = 36  # of a turn that are looked at for the one that shows most of the logo
# From where the ball is looked at: behind the hitter, to the right and above, so that top, side and corkscrew can be
# told apart. In right, up, forward of the hitter's frame.
EYE = np.array([0.62, 0.42, -0.66])


def view_frame(detail: Mapping[str, Any]) -> Floats:
    """(3, 3) rows right, up and towards the eye in the camera frame; the camera's own where the ball does not fly."""
    if detail["hitter"] is None:
        return np.diag([1.0, -1.0, -1.0])
    hitter = np.array(detail["hitter"])
    towards = EYE @ hitter / np.linalg.norm(EYE)
    right = np.cross(hitter[1], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def ink_of(detail: Mapping[str, Any]) -> Bytes | None:
    """(n, n) uint8 ink on the ball, as `logo_texture` gives it; None where the logo was not seen."""
    if detail["texture"] is None:
        return None
    import cv2  # 60 ms to load

    packed = np.frombuffer(base64.b64decode(detail["texture"]), np.uint8)
    ink: Bytes = np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), np.uint8)
    return ink


def ball_picture(
    detail: Mapping[str, Any], side_px: int, t_us: float | None = None, finer: int = FINER
) -> Bytes | None:
    """(side_px, side_px, 3) uint8 RGB picture at an instant, by default one that shows the logo; None without a spin.

    Parameters
    ----------
    detail : mapping
        As `shot_detail` gives it.
    t_us : float, optional
        File time.
    finer : int
        Pixels each way that are painted behind one of the picture.
    """
    if detail["spin_rps"] is None:
        return None
    spin_rps, frame, ink = np.array(detail["spin_rps"]), view_frame(detail), ink_of(detail)
    place = (np.arange(finer * side_px) + 0.5) / (finer * side_px) * 2 - 1
    x, y = np.meshgrid(place / BALL_SHARE, -place / BALL_SHARE)
    height = 1 - x * x - y * y
    inside = height > 0
    z = np.sqrt(np.where(inside, height, 0.0))
    picture = np.empty((*x.shape, 3))
    picture[:] = GROUND
    normals = np.stack([x[inside], y[inside], z[inside]], axis=1)
    cover = np.zeros(len(normals))
    if ink is not None:
        if t_us is None:
            turn = _phase(ink, spin_rps, frame[2])
        else:
            turn = rotations(2 * np.pi * (t_us - detail["reference_us"]) * 1e-6 * spin_rps)[0]
        smooth = _smoothed(ink)
        cover = smooth.ravel()[octahedral_pixels(normals @ frame @ turn, smooth.shape[0])] / 255
    colour = np.array(WHITE) + cover[:, None] * (np.array(INK) - np.array(WHITE))
    light = np.array([-0.35, 0.6, 0.72])  # from above, as in a hall
    picture[inside] = colour * (0.62 + 0.38 * np.clip(normals @ light, 0, 1))[:, None]
    _paint_axis(picture, frame @ spin_rps / np.linalg.norm(spin_rps), x, y, z, inside)
    small: Bytes = picture.reshape(side_px, finer, side_px, finer, 3).mean(axis=(1, 3)).round().astype(np.uint8)
    return small


def _smoothed(ink: Bytes) -> Bytes:
    """The ink with SMOOTH pixels each way for one, interpolated: looked up, its pixels are not seen."""
    import cv2  # 60 ms to load

    return np.asarray(cv2.resize(ink, None, fx=SMOOTH, fy=SMOOTH, interpolation=cv2.INTER_LINEAR), np.uint8)


def _phase(ink: Bytes, spin_rps: Floats, towards: Floats) -> Floats:
    """(3, 3) turn about the spin's axis from the reference time that shows most of the ink."""
    axis = spin_rps / max(float(np.linalg.norm(spin_rps)), 1e-9)
    turns = rotations(np.linspace(0, 2 * np.pi, PHASES, endpoint=False)[:, None] * axis)
    facing = np.clip(octahedral_directions(ink.shape[0]) @ (towards @ turns).T, 0, None)
    turn: Floats = turns[np.argmax(ink.ravel() @ facing)]
    return turn


def _paint_axis(picture: Floats, axis: Floats, x: Floats, y: Floats, z: Floats, inside: NDArray[np.bool_]) -> None:
    """Paint the axis through the ball, where the ball does not hide it, with an arrow's head at its end."""
    across = np.hypot(axis[0], axis[1])
    if across < 1e-6:
        return
    along = (x * axis[0] + y * axis[1]) / across  # in the picture
    off = np.abs(x * axis[1] - y * axis[0]) / across
    place = along / across  # of the axis's point behind the pixel, in ball radii from the centre
    outside = (np.abs(place) > 1) & (np.abs(place) <= AXIS_LENGTH)
    head = (place > 1.02) & (place <= AXIS_LENGTH)
    width = np.where(head, 0.16 * (AXIS_LENGTH - place) / (AXIS_LENGTH - 1.02), AXIS_WIDTH)
    hidden = inside & (place * axis[2] < z)
    picture[outside & (off < width) & ~hidden] = AXIS
