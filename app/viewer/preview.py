"""Preview of a tick: its close-ups side by side as one small picture, where the viewer is busy or absent."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.hsv import hsv_image
from spinscope.pipeline.tick import Tick

from . import entities as at
from .png import png
from .run import sentence, shown_estimate, vector_of

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]

SIDE_PX = 180  # of each pane: four are 720 px wide
REACH = 1.4  # half the width of a pane, in radii of the ball
EVENTS_SHOWN = 6000  # the latest ones are turned back, in 2 ms
FAST_SHARE = 0.98  # flow of this quantile has full colour
TITLES = ("Surface", "Logo events", "Flow", "Derotated logo")


def preview(ticks: Sequence[Tick]) -> bytes:
    """PNG of the last tick: surface with circles, logo events, flow, derotated logo; black panes without a ball.

    Parameters
    ----------
    ticks : sequence of Tick
        In order of time, at least one; those before the last one give the derotated logo its events.
    """
    tick = ticks[-1]
    panes = [np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8) for _ in TITLES]
    if tick.track.has_ball:
        x, y, _, _, radius = (float(value) for value in tick.track.mean)
        scale = SIDE_PX / (2 * REACH * radius)
        panes = [_surface(tick, x, y, scale), _logo(tick, scale), _flow(tick, radius), _derotated(ticks, scale)]
        for pane in panes[1:]:
            _circle(pane, 0.0, 0.0, radius, scale, at.KALMAN_COLOUR)
    return png(np.concatenate(panes, axis=1))


def preview_words(tick: Tick, *, is_whole: bool) -> str:
    """Answer of a tick in words: what is known so far; `is_whole` where the slow methods have run, too."""
    if not tick.track.has_ball:
        return sentence(tick.track.reason or tick.track.status)
    estimate, is_trusted = shown_estimate(tick)
    if estimate is None or estimate.magnitude_rps is None:
        return "Spin not known yet"
    std = "" if estimate.magnitude_std_rps is None else f" ± {estimate.magnitude_std_rps:.1f}"
    doubt = "" if is_trusted else ", not trusted" if is_whole else ", slower methods still to come"
    return f"{estimate.magnitude_rps:.1f}{std} rps so far{doubt}"


def _surface(tick: Tick, x: float, y: float, scale: float) -> Bytes:
    """The surface around the ball, with the refined circle and the Kalman filter's."""
    middle = (SIDE_PX - 1) / 2
    place = np.array([[scale, 0, middle - scale * x], [0, scale, middle - scale * y]])
    grey = cv2.warpAffine(tick.surface.values, place, (SIDE_PX, SIDE_PX))
    pane: Bytes = np.repeat(grey[..., None], 3, axis=2)
    found = tick.track.measured
    if found is not None:
        _circle(pane, found.x_px - x, found.y_px - y, found.radius_px, scale, at.MEASURED_COLOUR)
    _circle(pane, 0.0, 0.0, float(tick.track.mean[4]), scale, at.KALMAN_COLOUR)
    return pane


def _logo(tick: Tick, scale: float) -> Bytes:
    """Logo events by their polarity around the ball's centre."""
    logo = tick.logo
    return _points(np.asarray(logo.x_px) * scale, np.asarray(logo.y_px) * scale, logo.events.on)


def _flow(tick: Tick, radius_px: float) -> Bytes:
    """Flow of Triplet Matching: hue is the direction, saturation the speed."""
    flow, reach_px = tick.flow, REACH * radius_px
    speeds = np.hypot(flow.vx_px_s, flow.vy_px_s)
    bound_px_s = float(np.quantile(speeds, FAST_SHARE)) if len(speeds) else 1.0
    places = flow.events.x_px, flow.events.y_px, flow.vx_px_s, flow.vy_px_s
    size_px = max(int(2 * reach_px), 1)
    picture = hsv_image(*places, bound_px_s=max(bound_px_s, 1.0), radius_px=reach_px, size_px=size_px)
    return np.asarray(cv2.resize(picture, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_NEAREST), np.uint8)


def _derotated(ticks: Sequence[Tick], scale: float) -> Bytes:
    """Events of the shot so far, turned on by the shown spin to the end of the last tick: the side to the camera."""
    last = ticks[-1]
    own = [tick.logo.turning for tick in ticks if tick.track.has_ball and tick.track.shot == last.track.shot]
    normals, on, t_us = (np.concatenate([getattr(part, name) for part in own]) for name in ("normals", "on", "t_us"))
    normals, on, t_us = normals[-EVENTS_SHOWN:], on[-EVENTS_SHOWN:], t_us[-EVENTS_SHOWN:]
    turned = _turned(normals, vector_of(shown_estimate(last)[0]), (last.packet.end_us - t_us) * 1e-6)
    seen = turned[:, 2] < 0
    radius = float(last.track.mean[4]) * scale
    return _points(turned[seen, 0] * radius, turned[seen, 1] * radius, on[seen])


def _turned(normals: Floats, spin_rps: Floats, seconds: Floats) -> Floats:
    """Directions (n, 3) turned by a spin for so many seconds each (Rodrigues)."""
    rate = float(np.linalg.norm(spin_rps))
    if rate == 0:
        return normals
    axis = spin_rps / rate
    angle = 2 * np.pi * rate * seconds[:, None]
    along = (normals @ axis)[:, None] * axis
    turned: Floats = along + (normals - along) * np.cos(angle) + np.cross(axis, normals) * np.sin(angle)
    return turned


def _points(x: Floats, y: Floats, on: NDArray[np.bool_]) -> Bytes:
    """Points (n,) in pixels from the middle of a pane, in the colours of their polarity."""
    pane = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)
    columns, rows = (np.rint(value + (SIDE_PX - 1) / 2).astype(np.int64) for value in (x, y))
    inside = (columns >= 0) & (columns < SIDE_PX - 1) & (rows >= 0) & (rows < SIDE_PX - 1)
    colours = np.where(np.asarray(on)[inside, None], at.ON, at.OFF).astype(np.uint8)
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):  # two pixels wide: one is hard to see
        pane[rows[inside] + down, columns[inside] + right] = colours
    return pane


def _circle(pane: Bytes, x_px: float, y_px: float, radius_px: float, scale: float, colour: at.Colour) -> None:
    middle = (SIDE_PX - 1) / 2
    centre = round(middle + scale * x_px), round(middle + scale * y_px)
    cv2.circle(pane, centre, round(scale * radius_px), colour, 1, cv2.LINE_AA)
