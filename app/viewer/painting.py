"""The logo with the spin taken out: painted on the ball, flat on two discs, and unrolled about the spin's axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spinscope.pipeline.kernels.derotated_logo import CELLS, Canvas, centroid, count_derotated, paint

from . import entities as at
from .rerun_api import Chunk, columns_at, once, styled
from .run import ViewedRun, shot_starts, shown_estimate, vector_of
from .still import MAP_PX, TEXTURE_PX, disc_directions, disc_mask, map_directions, map_frame, texture_directions

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

# The logo is painted every tick of 200 Hz; less often in a long run, for a painting takes 140 kB.
PICTURE_US, PICTURES_MOST = 5000, 200
EVENTS_PAINTED = 60_000  # the latest of the shot; more add nothing but time
PAINT = np.array([[32, 42, 80]], np.float32)
WHITE = np.array([238, 236, 228], np.float32)
DISC = np.array([38, 43, 51], np.float32)
POLARITIES = np.array([at.OFF, at.ON], np.float32)
TO_CAMERA = np.array([0.0, 0.0, -1.0])


def painting_chunks(run: ViewedRun) -> list[Chunk]:
    """The logo's events turned back by the estimate of the moment: on the ball's texture, on two discs, unrolled."""
    times, pictures = [np.array([run.start_us])], [[nothing[None]] for nothing in _nothing()]
    for shot in _painted_shots(run):
        times.append(run.ends_us[shot.pictured])
        for column, painted in zip(pictures, shot.pictures(), strict=True):
            column.append(painted)
    t_us = np.concatenate(times)
    texture, discs, maps = (np.concatenate(column) for column in pictures)
    buffer, form = _raw(texture)
    skin = rr.Mesh3D.columns(albedo_texture_buffer=buffer, albedo_texture_format=form)
    chunks = [columns_at(at.MESH, t_us, skin), _graticule()]
    for entity, flat in ((at.STILL_LOGO, discs), (at.UNROLLED, maps)):
        buffer, form = _raw(flat)
        chunks.append(columns_at(entity, t_us, rr.Image.columns(buffer=buffer, format=form)))
        chunks.append(styled(entity, rr.Image, magnification_filter="linear", draw_order=-10.0))
    return chunks


@dataclass(frozen=True)
class _Shot:
    """The events of a shot that turn with the ball.

    normals : (n, 3) where they lie on the ball; on : (n,) their polarity; seconds : (n,) from each to the shot's start
    pictured : the ticks at which they are painted; ends : how many events there are at the end of each of these
    spins_rps : (m, 3) the spin of these ticks
    """

    normals: Floats
    on: NDArray[np.bool_]
    seconds: Floats
    pictured: list[int]
    ends: NDArray[np.int64]
    spins_rps: Floats

    def pictures(self) -> list[Bytes]:
        """(m, height, width, 3) the ball's texture, the two discs and the unrolled map, at every pictured tick."""
        seen = np.stack([np.maximum(self.ends - EVENTS_PAINTED, 0), self.ends], axis=1)
        middle = self._middle(slice(*seen[-1]))
        body = np.tile(np.eye(3), (len(self.pictured), 1, 1))
        frames = np.array([map_frame(spin_rps, middle) for spin_rps in self.spins_rps])
        made = [np.repeat(nothing[None], len(self.pictured), axis=0) for nothing in _nothing()]
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
        """The direction in which the logo lies, by the shot's last estimate; to the camera where there is none."""
        density = np.empty((CELLS, CELLS, CELLS, 3), np.float32)
        count_derotated(density, self.normals[seen], self.on[seen], self.seconds[seen], self.spins_rps[-1])
        direction = centroid(density)
        return direction if direction.any() else TO_CAMERA


def _painted_shots(run: ViewedRun) -> Iterator[_Shot]:
    """Every shot with what is painted of it."""
    parts: dict[int, tuple[int, list[int]]] = {}
    for index, (tick, start_us) in enumerate(zip(run.ticks, shot_starts(run), strict=True)):
        if start_us is not None:
            assert tick.track.shot is not None
            parts.setdefault(tick.track.shot, (start_us, []))[1].append(index)
    every_us = max(PICTURE_US, (run.end_us - run.start_us) // PICTURES_MOST)
    last_us = run.start_us - every_us
    for start_us, indices in parts.values():
        parts_of = [run.ticks[index].logo.turning for index in indices]
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
        yield _Shot(normals, on, (start_us - t_us) * 1e-6, ticks, ends[pictured], spins_rps)


def _raw(pictures: Bytes) -> tuple[Bytes, list[rr.components.ImageFormat]]:
    """The bytes of RGB pictures (m, height, width, 3) as rows, and what they are."""
    count, height, width, _ = pictures.shape
    form = rr.components.ImageFormat(width=width, height=height, color_model="RGB", channel_datatype="U8")
    return pictures.reshape(count, -1), [form] * count


def _graticule() -> Chunk:
    """The map's equator, its quarters of a turn, and what is up."""
    width, height = MAP_PX
    across = [[[0, height * part], [width, height * part]] for part in (0.0, 0.5, 1.0)]
    down = [[[width * part, 0], [width * part, height]] for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return once(at.GRATICULE, rr.LineStrips2D([*across, *down], colors=[(*at.MASK_COLOUR, 90)], radii=[-0.5]))


@cache
def _nothing() -> tuple[Bytes, Bytes, Bytes]:
    """The texture, the discs and the map before anything is painted: (height, width, 3) each."""
    discs = np.full((*disc_mask().shape, 3), at.BACKGROUND, np.uint8)
    discs[disc_mask()] = DISC
    texture, maps = ((size[1], size[0], 3) for size in (TEXTURE_PX, MAP_PX))
    return np.full(texture, WHITE, np.uint8), discs, np.full(maps, DISC, np.uint8)


@cache
def _texture() -> Canvas:
    """The ball's own skin."""
    directions = texture_directions().reshape(-1, 3)
    return Canvas(np.arange(len(directions)), directions, PAINT, WHITE)


def _discs(middle: Floats) -> Canvas:
    """The two halves of the ball side by side, the left one around this direction of the body frame."""
    return Canvas(np.flatnonzero(disc_mask()), disc_directions(middle), POLARITIES, DISC)


@cache
def _map() -> Canvas:
    """All of the ball, unrolled."""
    directions = map_directions().reshape(-1, 3)
    return Canvas(np.arange(len(directions)), directions, POLARITIES, DISC)
