"""The logo with the spin taken out: painted on the ball, flat on two discs, and unrolled about the spin's axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pipeline.kernels.still import colour_counts, read_density, turn_back_and_count

from . import entities as at
from .rerun_api import Chunk, columns_at, once
from .run import Run, shot_starts, shown_estimate, vector_of
from .stages import PNG_QUICK
from .still import CELLS, MAP_PX, TEXTURE_PX, disc_directions, map_directions, map_frame, texture_directions

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

PICTURE_US = 5000  # the logo is painted this often, and every tick of 200 Hz
EVENTS_PAINTED = 60_000  # the latest of the shot; more add nothing but time
PAINT = np.array([[32, 42, 80]], np.float32)
WHITE = np.array([238, 236, 228], np.float32)
DISC_BGR = np.array([51, 43, 38], np.float32)
POLARITIES_BGR = np.array([at.OFF[::-1], at.ON[::-1]], np.float32)
BODY = np.eye(3)
TO_CAMERA = np.array([0.0, 0.0, -1.0])


def painting_chunks(run: Run) -> list[Chunk]:
    """The logo's events turned back by the estimate of the moment: on the ball's texture, on two discs, unrolled."""
    nothing = np.zeros((CELLS, CELLS, CELLS, 3), np.float32)
    times, textures = [run.start_us], [_texture(nothing)]
    discs, maps = [_discs_around(TO_CAMERA).picture(nothing)], [_map().picture(nothing)]
    for shot in _painted_shots(run):
        density = np.empty_like(nothing)
        middle = shot.middle(density)
        flat = _discs_around(middle)
        for index in shot.pictured:
            spin_rps = shot.count(density, index)
            times.append(run.ticks[index].packet.end_us)
            textures.append(_texture(density))
            discs.append(flat.picture(density))
            maps.append(_map().picture(density, map_frame(spin_rps, middle)))
    t_us = np.array(times)
    width, height = TEXTURE_PX
    form = rr.components.ImageFormat(width=width, height=height, color_model="RGB", channel_datatype="U8")
    columns = rr.Mesh3D.columns(albedo_texture_buffer=textures, albedo_texture_format=[form] * len(times))
    return [
        columns_at(at.MESH, t_us, columns),
        *(
            chunk
            for entity, pictures in ((at.STILL_LOGO, discs), (at.UNROLLED, maps))
            for chunk in (
                columns_at(entity, t_us, rr.EncodedImage.columns(blob=pictures)),
                once(entity, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
            )
        ),
        _graticule(),
    ]


@dataclass(frozen=True)
class _Shot:
    """The events of a shot that turn with the ball.

    normals : (n, 3) where they lie on the ball; on : (n,) their polarity; seconds : (n,) from each to the shot's start
    ends : how many there are at the end of every tick; pictured : the ticks at which they are painted
    """

    run: Run
    normals: Floats
    on: NDArray[np.bool_]
    seconds: Floats
    ends: dict[int, int]
    pictured: list[int]

    def count(self, density: Singles, index: int) -> Floats:
        """Fill `density` with the events up to a tick, in the body frame; the spin by which they were turned back."""
        spin_rps = vector_of(shown_estimate(self.run.ticks[index])[0])
        seen = slice(max(self.ends[index] - EVENTS_PAINTED, 0), self.ends[index])
        turn_back_and_count(density, self.normals[seen], self.on[seen], self.seconds[seen], spin_rps)
        return spin_rps

    def middle(self, density: Singles) -> Floats:
        """The direction in which the logo lies, by the shot's last estimate; to the camera where there is none."""
        self.count(density, self.pictured[-1])
        counts = density[..., :2].sum(axis=3)
        places = np.arange(CELLS) - (CELLS - 1) / 2
        sides = (counts.sum(axis=(1, 2)), counts.sum(axis=(0, 2)), counts.sum(axis=(0, 1)))
        direction = np.array([places @ side for side in sides])
        return direction if np.linalg.norm(direction) > 0 else TO_CAMERA


def _painted_shots(run: Run) -> Iterator[_Shot]:
    """Every shot with what is painted of it."""
    parts: dict[int, tuple[int, list[int]]] = {}
    for index, (tick, start_us) in enumerate(zip(run.ticks, shot_starts(run), strict=True)):
        if start_us is not None:
            assert tick.track.shot is not None
            parts.setdefault(tick.track.shot, (start_us, []))[1].append(index)
    last_us = -PICTURE_US
    for start_us, indices in parts.values():
        parts_of = [run.ticks[index].logo.turning for index in indices]
        normals, on, t_us = (
            np.concatenate([getattr(part, name) for part in parts_of]) for name in ("normals", "on", "t_us")
        )
        ends = dict(zip(indices, np.cumsum([len(part) for part in parts_of]).tolist(), strict=True))
        pictured = []
        for index in indices:
            if run.ticks[index].packet.end_us - last_us >= PICTURE_US or index == indices[-1]:
                last_us = run.ticks[index].packet.end_us
                pictured.append(index)
        yield _Shot(run, normals, on, (start_us - t_us) * 1e-6, ends, pictured)


def _texture(density: Singles) -> bytes:
    """RGB of the ball's texture."""
    directions = _texture_directions()
    counts, texture = np.empty((2, len(directions)), np.float32), np.empty((len(directions), 3), np.uint8)
    read_density(counts, density, directions, BODY)
    colour_counts(texture, np.arange(len(texture)), counts.sum(axis=0, keepdims=True), PAINT, WHITE)
    return texture.tobytes()


class _Flat:
    """A flat picture of the ball: which direction lies behind which of its pixels."""

    def __init__(self, directions: Floats, mask: NDArray[np.bool_]) -> None:
        """directions : (height, width, 3); mask : (height, width) which pixels have one."""
        self._directions = directions[mask]
        self._places = np.flatnonzero(mask)
        self._empty = np.full((*mask.shape, 3), at.BACKGROUND, np.uint8)

    def picture(self, density: Singles, frame: Floats = BODY) -> bytes:
        """PNG with ON's and OFF's densities in their colours; the rows of `frame` are the picture's axes."""
        counts = np.empty((2, len(self._directions)), np.float32)
        read_density(counts, density, self._directions, frame)
        picture = self._empty.copy()
        colour_counts(picture.reshape(-1, 3), self._places, counts, POLARITIES_BGR, DISC_BGR)
        return bytes(cv2.imencode(".png", picture, PNG_QUICK)[1])


def _graticule() -> Chunk:
    """The map's equator, its quarters of a turn, and what is up."""
    width, height = MAP_PX
    across = [[[0, height * part], [width, height * part]] for part in (0.0, 0.5, 1.0)]
    down = [[[width * part, 0], [width * part, height]] for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return once(at.GRATICULE, rr.LineStrips2D([*across, *down], colors=[(*at.MASK_COLOUR, 90)], radii=[-0.5]))


@cache
def _texture_directions() -> Floats:
    return texture_directions().reshape(-1, 3)


def _discs_around(middle: Floats) -> _Flat:
    """The two halves of the ball side by side, the left one around this direction of the body frame."""
    return _Flat(*disc_directions(middle))


@cache
def _map() -> _Flat:
    directions = map_directions()
    return _Flat(directions, np.ones(directions.shape[:2], np.bool_))
