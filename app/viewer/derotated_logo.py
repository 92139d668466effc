"""Drawing of the derotated logo: on the ball, flat on two discs, and unrolled about the spin's axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spinscope.pipeline.kernels.derotated_logo import CELLS, Canvas, centroid, count_derotated, paint

from . import entities as at
from .ball_projections import (
    MAP_PX,
    TEXTURE_PX,
    disc_directions,
    disc_mask,
    map_directions,
    map_frame,
    texture_directions,
)
from .rerun_api import Chunk, columns_at, once, styled
from .run import ViewedRun, shot_starts, shown_estimate, vector_of

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

# Every tick of 200 Hz has its pictures; fewer in a long run, for those of a tick take 140 kB.
PICTURE_US, MAX_PICTURES = 5000, 200
MAX_EVENTS = 60_000  # the latest of the shot; more add nothing but time
INK = np.array([[32, 42, 80]], np.float32)
WHITE = np.array([238, 236, 228], np.float32)
DISC = np.array([38, 43, 51], np.float32)
POLARITY_COLOURS = np.array([at.OFF, at.ON], np.float32)
TO_CAMERA = np.array([0.0, 0.0, -1.0])


def derotated_logo_chunks(run: ViewedRun) -> list[Chunk]:
    """Logo events turned back by the estimate of the moment: on the ball's texture, on two discs, unrolled."""
    times, pictures = [np.array([run.start_us])], [[blank[None]] for blank in _blanks()]
    for shot in _shots(run):
        times.append(run.ends_us[shot.pictured])
        for column, made in zip(pictures, shot.pictures(), strict=True):
            column.append(made)
    t_us = np.concatenate(times)
    texture, discs, maps = (np.concatenate(column) for column in pictures)
    buffer, form = _raw(texture)
    surface = rr.Mesh3D.columns(albedo_texture_buffer=buffer, albedo_texture_format=form)
    chunks = [columns_at(at.MESH, t_us, surface), _graticule()]
    for entity, flat in ((at.DEROTATED_LOGO, discs), (at.UNROLLED, maps)):
        buffer, form = _raw(flat)
        chunks.append(columns_at(entity, t_us, rr.Image.columns(buffer=buffer, format=form)))
        chunks.append(styled(entity, rr.Image, magnification_filter="linear", draw_order=-10.0))
    return chunks


@dataclass(frozen=True)
class _RotatingEvents:
    """Events of a shot that turn with the ball.

    Attributes
    ----------
    normals : (n, 3) float64
        Surface normals where they lie on the ball.
    on : (n,) bool
        Polarity.
    seconds : (n,) float64
        Time from each event to the shot's start.
    pictured : list of int
        Numbers of the m ticks that have pictures.
    ends : (m,) int64
        Number of events up to the end of each of these.
    spins_rps : (m, 3) float64
        Spin at these ticks.
    """

    normals: Floats
    on: NDArray[np.bool_]
    seconds: Floats
    pictured: list[int]
    ends: NDArray[np.int64]
    spins_rps: Floats

    def pictures(self) -> list[Bytes]:
        """Texture of the ball, two discs and unrolled map at every pictured tick, (m, height, width, 3) each."""
        seen = np.stack([np.maximum(self.ends - MAX_EVENTS, 0), self.ends], axis=1)
        middle = self._middle(slice(*seen[-1]))
        body = np.tile(np.eye(3), (len(self.pictured), 1, 1))
        frames = np.array([map_frame(spin_rps, middle) for spin_rps in self.spins_rps])
        made = [np.repeat(blank[None], len(self.pictured), axis=0) for blank in _blanks()]
        paint(
            tuple(pictures.reshape(len(pictures), -1, 3) for pictures in made),
            (_texture(), _discs(middle), _map()),
            (body, body, frames),
            self.normals,
            self.on,
            self.seconds,
            seen,
            self.spins_rps,
        )
        return made

    def _middle(self, seen: slice) -> Floats:
        """Direction of the logo's centroid by the shot's last estimate; to the camera where there is none."""
        density = np.empty((CELLS, CELLS, CELLS, 3), np.float32)
        count_derotated(density, self.normals[seen], self.on[seen], self.seconds[seen], self.spins_rps[-1])
        direction = centroid(density)
        return direction if direction.any() else TO_CAMERA


def _shots(run: ViewedRun) -> Iterator[_RotatingEvents]:
    """Rotating events of every shot, where the logo was looked for."""
    logos = run.results("logo")
    parts: dict[int, tuple[int, list[int]]] = {}
    for index, (tick, start_us) in enumerate(zip(run.ticks, shot_starts(run), strict=True)):
        if logos and start_us is not None:
            assert tick.track.shot is not None
            parts.setdefault(tick.track.shot, (start_us, []))[1].append(index)
    every_us = max(PICTURE_US, (run.end_us - run.start_us) // MAX_PICTURES)
    last_us = run.start_us - every_us
    for start_us, indices in parts.values():
        parts_of = [logos[index].turning for index in indices]
        normals, on, t_us = (
            np.concatenate([getattr(part, name) for part in parts_of]) for name in ("normals", "on", "t_us")
        )
        ends = np.cumsum([len(part) for part in parts_of])
        pictured = []
        for place, index in enumerate(indices):
            if run.ticks[index].packet.end_us - last_us >= every_us or index == indices[-1]:
                last_us = run.ticks[index].packet.end_us
                pictured.append(place)
        ticks = [indices[place] for place in pictured]
        spins_rps = np.array([vector_of(shown_estimate(run.ticks[index])[0]) for index in ticks])
        yield _RotatingEvents(normals, on, (start_us - t_us) * 1e-6, ticks, ends[pictured], spins_rps)


def _raw(pictures: Bytes) -> tuple[Bytes, list[rr.components.ImageFormat]]:
    """Bytes of RGB pictures (m, height, width, 3) as rows, and their format."""
    count, height, width, _ = pictures.shape
    form = rr.components.ImageFormat(width=width, height=height, color_model="RGB", channel_datatype="U8")
    return pictures.reshape(count, -1), [form] * count


@cache
def _graticule() -> Chunk:
    """Equator and poles of the map, and its quarters of a turn."""
    width, height = MAP_PX
    across = [[[0, height * part], [width, height * part]] for part in (0.0, 0.5, 1.0)]
    down = [[[width * part, 0], [width * part, height]] for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return once(at.GRATICULE, rr.LineStrips2D([*across, *down], colors=[(*at.MASK_COLOUR, 90)], radii=[-0.5]))


def bounds() -> Floats:
    """Extent of the two discs' picture, (2, 2), px: x and y, from and to."""
    height, width = disc_mask().shape
    return np.array([[0.0, width], [0.0, height]])


@cache
def _blanks() -> tuple[Bytes, Bytes, Bytes]:
    """Texture, discs and map without events, (height, width, 3) each."""
    discs = np.full((*disc_mask().shape, 3), at.BACKGROUND, np.uint8)
    discs[disc_mask()] = DISC
    texture, maps = ((size[1], size[0], 3) for size in (TEXTURE_PX, MAP_PX))
    return np.full(texture, WHITE, np.uint8), discs, np.full(maps, DISC, np.uint8)


@cache
def _texture() -> Canvas:
    """The ball's texture."""
    directions = texture_directions().reshape(-1, 3)
    return Canvas(np.arange(len(directions)), directions, INK, WHITE)


def _discs(middle: Floats) -> Canvas:
    """Two halves of the ball side by side, the left one around this direction of the body frame."""
    return Canvas(np.flatnonzero(disc_mask()), disc_directions(middle), POLARITY_COLOURS, DISC)


@cache
def _map() -> Canvas:
    """The whole ball, unrolled."""
    directions = map_directions().reshape(-1, 3)
    return Canvas(np.arange(len(directions)), directions, POLARITY_COLOURS, DISC)
