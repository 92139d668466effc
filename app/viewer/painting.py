"""The logo with the spin taken out: painted on the ball, flat on two discs, and unrolled about the spin's axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from . import entities as at
from .rerun_api import Chunk, columns_at, once
from .run import Run, shot_starts, shown_estimate, vector_of
from .stages import PNG_QUICK
from .still import (
    MAP_PX,
    TEXTURE_PX,
    Sampler,
    density,
    disc_directions,
    map_directions,
    map_frame,
    texture_directions,
    tone,
    turned,
)

Floats = NDArray[np.float64]

PICTURE_US = 5000  # the logo is painted this often, and every tick of 200 Hz
EVENTS_PAINTED = 60_000  # the latest of the shot; more add nothing but time
PAINT = np.array([32, 42, 80], np.float32)
WHITE = np.array([238, 236, 228], np.float32)
DISC = np.array([38, 43, 51])


@dataclass(frozen=True)
class _Painted:
    """The logo events of a shot up to one tick, in the body frame.

    normals : (n, 3) where they lie on the ball; on : (n,) their polarity; spin_rps : (3,) by which they were turned
    back, zeros where there is no estimate
    """

    normals: Floats
    on: NDArray[np.bool_]
    spin_rps: Floats

    @cached_property
    def densities(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """ON's and OFF's, in the body frame."""
        return density(self.normals[self.on]), density(self.normals[~self.on])


def painting_chunks(run: Run) -> list[Chunk]:
    """The logo's events turned back by the estimate of the moment: on the ball's texture, on two discs, unrolled."""
    width, height = TEXTURE_PX
    shots: dict[int, tuple[Floats, _Flat]] = {}
    times = [run.start_us]
    textures = [np.broadcast_to(WHITE.astype(np.uint8), (height, width, 3)).tobytes()]
    discs, maps = [_blank_discs()], [_blank_map()]
    for index, painted in _painted(run):
        shot = run.ticks[index].track.shot
        assert shot is not None
        if shot not in shots:
            middle = _densest(run, shot)
            shots[shot] = middle, _discs_around(middle)
        middle, flat = shots[shot]
        times.append(run.ticks[index].packet.end_us)
        textures.append(_texture(painted).tobytes())
        discs.append(flat.picture(*painted.densities))
        maps.append(_unrolled(painted, middle))
    t_us = np.array(times)
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


def _painted(run: Run) -> Iterator[tuple[int, _Painted]]:
    """The ticks at which the logo is painted, with the shot's events so far in the body frame."""
    parts: list[int] = []
    last_us = -PICTURE_US
    for index, (tick, start_us) in enumerate(zip(run.ticks, shot_starts(run), strict=True)):
        if start_us is None or (parts and run.ticks[parts[-1]].track.shot != tick.track.shot):
            parts = []
        if start_us is None:
            continue
        parts.append(index)
        ends = index + 1 == len(run.ticks) or run.ticks[index + 1].track.shot != tick.track.shot
        if tick.packet.end_us - last_us >= PICTURE_US or ends:
            last_us = tick.packet.end_us
            yield index, _turned_back(run, parts, start_us, vector_of(shown_estimate(tick)[0]))


def _turned_back(run: Run, parts: list[int], start_us: int, spin_rps: Floats) -> _Painted:
    """The events of these ticks that turn with the ball."""
    events = [run.ticks[i].logo.turning for i in parts]
    normals = np.concatenate([part.normals for part in events])[-EVENTS_PAINTED:]
    t_us = np.concatenate([part.t_us for part in events])[-EVENTS_PAINTED:]
    on = np.concatenate([part.on for part in events])[-EVENTS_PAINTED:]
    return _Painted(turned(normals, spin_rps, (start_us - t_us) * 1e-6), on, spin_rps)


def _densest(run: Run, shot: int) -> Floats:
    """The direction in which a shot's logo lies, by its last estimate; towards the camera where there is none."""
    parts = [i for i, tick in enumerate(run.ticks) if tick.track.shot == shot]
    start_us = run.ticks[parts[0]].packet.start_us
    painted = _turned_back(run, parts, start_us, vector_of(shown_estimate(run.ticks[parts[-1]])[0]))
    direction: Floats = painted.normals.sum(axis=0)
    return direction if np.linalg.norm(direction) > 0 else np.array([0.0, 0.0, -1.0])


def _full(counts: NDArray[np.float32]) -> float:
    """The count that is shown in full colour: what a twentieth of the marked places exceed."""
    marked = counts[counts > 0]
    if not marked.size:
        return 0.0
    rank = int(0.95 * (marked.size - 1))
    return float(np.partition(marked, rank)[rank])


def _texture(painted: _Painted) -> NDArray[np.uint8]:
    on, off = painted.densities
    counts = _texture_sampler()(on + off)
    strength = tone(counts, _full(counts))[..., None]
    texture: NDArray[np.uint8] = (WHITE + strength * (PAINT - WHITE)).astype(np.uint8)
    return texture


@dataclass(frozen=True)
class _Flat:
    """A flat picture of the ball: which direction lies behind which of its pixels.

    mask : (height, width) which pixels have one; sampler : of these, in order
    """

    sampler: Sampler
    mask: NDArray[np.bool_]

    @cached_property
    def ground(self) -> NDArray[np.float32]:
        """(n, 3) the colour of an empty ball behind these pixels."""
        return np.tile(DISC.astype(np.float32), (int(self.mask.sum()), 1))

    def picture(self, *densities: NDArray[np.float32]) -> bytes:
        """PNG with ON's and OFF's densities in their colours."""
        colours = self.ground.copy()
        for density_of, colour in zip(densities, (at.ON, at.OFF), strict=False):
            counts = self.sampler(density_of)
            seen = np.flatnonzero(counts)
            strength = tone(counts[seen], _full(counts))[:, None]
            colours[seen] += strength * (np.array(colour) - DISC).astype(np.float32)
        picture = np.full((*self.mask.shape, 3), at.BACKGROUND, np.uint8)
        picture[self.mask] = np.clip(colours, 0, 255, out=colours)
        return bytes(cv2.imencode(".png", picture[..., ::-1], PNG_QUICK)[1])


def _unrolled(painted: _Painted, middle: Floats) -> bytes:
    """PNG of the map about the axis, the logo in its middle; about the vertical while there is no spin."""
    frame = map_frame(painted.spin_rps, middle)
    normals = painted.normals @ frame.T
    return _map().picture(density(normals[painted.on]), density(normals[~painted.on]))


def _graticule() -> Chunk:
    """The map's equator, its quarters of a turn, and what is up."""
    width, height = MAP_PX
    across = [[[0, height * part], [width, height * part]] for part in (0.0, 0.5, 1.0)]
    down = [[[width * part, 0], [width * part, height]] for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return once(at.GRATICULE, rr.LineStrips2D([*across, *down], colors=[(*at.MASK_COLOUR, 90)], radii=[-0.5]))


@cache
def _texture_sampler() -> Sampler:
    return Sampler(texture_directions())


def _discs_around(middle: Floats) -> _Flat:
    """The two halves of the ball side by side, the left one around this direction of the body frame."""
    directions, mask = disc_directions(middle)
    return _Flat(Sampler(directions[mask]), mask)


@cache
def _blank_discs() -> bytes:
    return _discs_around(np.array([0.0, 0.0, -1.0])).picture()


@cache
def _map() -> _Flat:
    directions = map_directions()
    return _Flat(Sampler(directions.reshape(-1, 3)), np.ones(directions.shape[:2], np.bool_))


@cache
def _blank_map() -> bytes:
    return _map().picture()
