"""Drawing of the ball in space: its attitude, spin arrows, flight path."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from . import entities as at
from .ball_projections import sphere
from .rerun_api import Chunk, columns_at, once, strips, styled
from .run import ViewedRun, shot_starts, shown_estimate, vector_of

Floats = NDArray[np.float64]

MOTION_US = 250  # the ball is placed and turned this often: 4.5 degrees at 50 rps, smooth in slow motion
RPS_M = 0.00035  # an arrow's length: 100 rps reach 35 mm beyond the ball
# From where the views in space look: as the camera does, tilted by 40 degrees towards the image's lower edge.
TILT = np.radians(40)
EYE = np.array([0.0, np.sin(TILT), -np.cos(TILT)])
RING_RADII, RING_POINTS = 1.18, 51  # of the ring that shows which way the ball turns


def ball_chunks(run: ViewedRun) -> list[Chunk]:
    """Everything in space but the logo on the ball."""
    chunks = [_mesh(run.ball_radius_m), *_motion(run), *_arrows(run), *_ring(run), *_path(run), *_axes(run)]
    return [once(at.WORLD, rr.ViewCoordinates.RDF), *chunks]


@lru_cache(8)
def _mesh(ball_radius_m: float) -> Chunk:
    """The sphere, in the body frame."""
    longitudes, latitudes = np.linspace(-np.pi, np.pi, 65), np.linspace(-np.pi / 2, np.pi / 2, 33)
    normals = sphere(longitudes[None, :], latitudes[:, None]).reshape(-1, 3)
    u, v = np.meshgrid(np.linspace(0, 1, 65), np.linspace(0, 1, 33))
    row, column = np.meshgrid(np.arange(32), np.arange(64), indexing="ij")
    first = (row * 65 + column).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 65, first + 1], 1), np.stack([first + 1, first + 65, first + 66], 1)]
    )
    return once(
        at.MESH,
        rr.Mesh3D(
            vertex_positions=normals * ball_radius_m,
            vertex_normals=normals,
            vertex_texcoords=np.stack([u.ravel(), v.ravel()], axis=1),
            triangle_indices=faces,
        ),
    )


def _motion(run: ViewedRun) -> list[Chunk]:
    """Place and attitude of the ball between the ticks, extrapolated from the last tick as a robot would have it."""
    times, places, quaternions = [], [], []
    for index, (tick, start_us) in enumerate(zip(run.ticks, shot_starts(run), strict=True)):
        if start_us is None:
            continue
        until_us = run.ends_us[index + 1] if index + 1 < len(run.ticks) else run.end_us + 1
        t_us = np.arange(tick.packet.end_us, until_us, MOTION_US)
        ahead = np.zeros((t_us.size, 5))
        ahead_s = (t_us - tick.packet.end_us) * 1e-6
        ahead[:, :2] = tick.track.mean[2:4] * ahead_s[:, None]
        times.append(t_us)
        places.append(run.centre_m(tick.track.mean + ahead))
        quaternions.append(_turned_by(vector_of(shown_estimate(tick)[0]), (t_us - start_us) * 1e-6))
    if not times:
        return [columns_at(at.BALL, run.times_us[:1], rr.Transform3D.columns(translation=[[0.0, 0.0, 1.0]]))]
    t_us = np.concatenate([*([run.times_us[:1]] if times[0][0] > run.start_us else []), *times])
    rows = np.maximum(np.arange(t_us.size) - (t_us.size - sum(map(len, times))), 0)
    place, quaternion = np.concatenate(places)[rows], np.concatenate(quaternions)[rows]
    return [
        columns_at(at.BALL, t_us, rr.Transform3D.columns(translation=place)),
        columns_at(at.BODY, t_us, rr.Transform3D.columns(quaternion=quaternion)),
    ]


def _turned_by(spin_rps: Floats, seconds: Floats) -> Floats:
    """Attitude (n, 4) after these times (n,), as quaternions x, y, z, w."""
    magnitude = float(np.linalg.norm(spin_rps))
    half = np.pi * magnitude * seconds
    axis = spin_rps / magnitude if magnitude else np.array([0.0, 0.0, 1.0])
    sines, cosines = np.sin(half), np.cos(half)
    return np.column_stack([sines[:, None] * axis, cosines])


def _arrows(run: ViewedRun) -> list[Chunk]:
    """Arrows out of the ball's surface along the axis: thin for every method and the truth, thick for the shown one."""
    chunks: list[Chunk] = []
    for method in run.methods:
        vectors = [vector_of(tick.estimates[method.name]) for tick in run.ticks]
        chunks += _arrow(run, f"{at.SPIN_ARROWS}/{method.name}", vectors, method.colour, 0.025)
    if run.true_spins_rps is not None:
        spins = np.nan_to_num(run.true_spins_rps) * run.has_ball[:, None]
        chunks += _arrow(run, f"{at.SPIN_ARROWS}/truth", list(spins), at.TRUTH_COLOUR, 0.02)
    shown = [shown_estimate(tick) for tick in run.ticks]
    notes = [
        ", not trusted" if not is_trusted else "" if row in run.final_shots else ", so far"
        for row, (_, is_trusted) in enumerate(shown)
    ]
    return [*chunks, *_arrow(run, at.SPIN_SHOWN, [vector_of(one) for one, _ in shown], at.RING_COLOUR, 0.06, notes)]


def _arrow(
    run: ViewedRun,
    entity: str,
    vectors: list[Floats],
    colour: at.Colour,
    thickness: float,
    notes: list[str] | None = None,
) -> list[Chunk]:
    """Arrow along a spin at every tick, labelled with a note on each; where it is not trusted pale."""
    spins = np.array(vectors).reshape(-1, 3)
    magnitudes = np.linalg.norm(spins, axis=1)
    known = magnitudes > 0
    said = [note for note, is_known in zip(notes or [""] * len(spins), known, strict=True) if is_known]
    axes = spins[known] / magnitudes[known, None]
    columns = rr.Arrows3D.columns(
        origins=axes * run.ball_radius_m,
        vectors=axes * (magnitudes[known, None] * RPS_M),
        labels=[f"{magnitude:.1f} rps{note}" for magnitude, note in zip(magnitudes[known], said, strict=True)],
        colors=[at.DOUBTED_COLOUR if "not trusted" in note else colour for note in said],
    )
    look = {"radii": thickness * run.ball_radius_m, "show_labels": entity == at.SPIN_SHOWN}
    return [styled(entity, rr.Arrows3D, **look), columns_at(entity, run.times_us, columns, [0, *known.astype(int)])]


def _ring(run: ViewedRun) -> list[Chunk]:
    """Ring around the shown axis with a gap, ending in an arrow that shows which way the ball turns."""
    spins = np.array([vector_of(shown_estimate(tick)[0]) for tick in run.ticks])
    magnitudes = np.linalg.norm(spins, axis=1)
    shown = run.has_ball & (magnitudes > 0)
    rings = _around(spins[shown] / magnitudes[shown, None]) * run.ball_radius_m
    lengths = [0, *shown.astype(int)]
    arrows = rr.Arrows3D.columns(origins=rings[:, -3], vectors=rings[:, -1] - rings[:, -3])
    radius = 0.025 * run.ball_radius_m
    return [
        styled(at.SPIN_RING, rr.LineStrips3D, colors=at.RING_COLOUR, radii=radius),
        columns_at(at.SPIN_RING, run.times_us, rr.LineStrips3D.columns(strips=strips(rings[:, :-2], 3)), lengths),
        styled(at.RING_TIP, rr.Arrows3D, colors=at.RING_COLOUR, radii=2.5 * radius),
        columns_at(at.RING_TIP, run.times_us, arrows, lengths),
    ]


def _around(axes: Floats) -> Floats:
    """Lines (n, RING_POINTS, 3) around each axis (n, 3) by the right-hand rule, in radii of the ball.

    Their tips are on the side from which the viewer looks.
    """
    viewers = np.where(np.abs(axes @ EYE)[:, None] < 0.95, EYE, [1.0, 0.0, 0.0])
    sides = viewers - (viewers * axes).sum(axis=1, keepdims=True) * axes
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    angle = np.radians(np.linspace(60, 370, RING_POINTS))[:, None]
    ring: Floats = np.cos(angle) * sides[:, None] + np.sin(angle) * np.cross(axes, sides)[:, None]
    return RING_RADII * ring


def _path(run: ViewedRun) -> list[Chunk]:
    """Flight path so far, a piece a tick (the view shows all pieces up to the playhead); the truth dashed."""
    chunks = [styled(at.PATH, rr.LineStrips3D, colors=at.PATH_COLOUR, radii=-2.0)]
    if run.fixed or not run.has_ball.any():
        return chunks
    places = run.centre_m(np.nan_to_num(run.means, nan=1.0))
    shots = [tick.track.shot for tick in run.ticks]
    goes_on = [run.has_ball[i] and i > 0 and shots[i] == shots[i - 1] for i in range(len(run.ticks))]
    pieces = [places[i - 1 : i + 1] for i, flies in enumerate(goes_on) if flies]
    flown = rr.LineStrips3D.columns(strips=strips(pieces, 3))
    chunks.append(columns_at(at.PATH, run.times_us, flown, [0, *map(int, goes_on)]))
    paths = [shot.positions_m(run.camera, run.ball_radius_m) for shot in run.shots]
    numbers = [str(number) for number in range(1, len(paths) + 1)]
    if paths:
        chunks.append(once(at.PATHS, rr.LineStrips3D(paths, colors=[at.OTHERS_COLOUR], radii=[-0.6], labels=numbers)))
    if run.truth is not None:
        positions = run.truth.position_m
        dashes = [positions[i : i + 6] for i in range(0, len(positions) - 6, 10)]
        style = rr.LineStrips3D(dashes, colors=[at.TRUTH_COLOUR], radii=[-1.0])
        chunks.append(once(at.TRUE_PATH, style))
    return chunks


def _axes(run: ViewedRun) -> list[Chunk]:
    """Axes of the camera frame, 0.1 m long, beside the path."""
    low, high = path_bounds_m(run)
    corner = np.array([low[0] - 0.25, (low[1] + high[1]) / 2, high[2]])
    arrows = rr.Arrows3D(
        origins=[corner] * 3,
        vectors=0.1 * np.eye(3),
        colors=[at.ON, at.KALMAN_COLOUR, at.OFF],
        labels=["x", "y", "z"],
        radii=[-1.5],
    )
    return [once(at.AXES, arrows)]


def path_bounds_m(run: ViewedRun) -> tuple[Floats, Floats]:
    """Opposite corners of the box around all places of the ball, camera frame; 0.1 m wide at least."""
    if not run.has_ball.any():
        return np.array([-0.4, -0.3, 1.9]), np.array([0.4, 0.3, 2.1])
    places = run.centre_m(run.means[run.has_ball])
    low, high = places.min(axis=0), places.max(axis=0)
    spare = np.maximum(0.1 - (high - low), 0.0) / 2
    return low - spare, high + spare
