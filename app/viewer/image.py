"""Drawings in the image and in the ball's frame: events, surface, circles, logo, flow; one function a stage.

Every result stands at the end of its tick, when it was known; the state it describes is older by the pixels'
latency (65 us or so). A first row at the start of the run says that nothing is known yet, so that no view is empty
wherever the playhead stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.hsv import hsv_image, hsv_wheel
from spinscope.pipeline.results import Circle

from . import entities as at
from .png import png
from .rerun_api import Chunk, columns_at, once, states, strips, styled
from .run import ViewedRun

Floats = NDArray[np.float64]

EVENTS_SHOWN = 1_500_000  # of more, every second, third ... is shown: 15 MB of points is what a flight may take
WHEEL_PX = 128
DASHES = 12
# Numbered circles are drawn around the balls, not upon the circles that the stages give; their tracks are cut off
# after so many ticks, half a second, so that those of a ball spinner do not fill the memory.
BESIDE_PX, TRACK_TICKS = 4.0, 100


def filter_chunks(run: ViewedRun) -> list[Chunk]:
    """Raw events in the colours of their polarity, dimmed where the surface's filter took them out; lamps' flicker."""
    total = sum(len(tick.packet.events) for tick in run.ticks)
    chosen = slice(None, None, max(1, -(-total // EVENTS_SHOWN)))
    positions, classes = [], []
    for tick in run.ticks:
        events, kept, start_us = tick.packet.events, tick.filter.surface_events, tick.packet.start_us
        is_kept = _are_among(events, kept, start_us)[chosen]
        positions.append(np.stack([events.x_px[chosen], events.y_px[chosen]], axis=1))
        is_flicker = _are_among(events, tick.filter.flicker_events, start_us)[chosen]
        flicker = 4 * is_flicker.astype(np.uint16)
        classes.append(flicker + 2 * is_kept + events.on[chosen])
    width, height = run.camera.width_px, run.camera.height_px
    frame = rr.Boxes2D(mins=[[-0.5, -0.5]], sizes=[[width, height]], colors=[at.MASK_COLOUR], radii=[-0.5])
    names = _names(run, at.POLARITY_NAMES, {"ON": at.ON, "OFF": at.OFF})
    return [once(at.FRAME, frame), names, *_events(run, at.EVENTS, positions, classes, radius_ui=1.0)]


def frame_chunks(run: ViewedRun) -> list[Chunk]:
    """Pictures that the camera took, each from the middle of its exposure on, beneath the events."""
    if not run.frames:
        return []
    # Pixels are named by their centres, see `surface_chunks`; all pictures of a camera begin at the same pixel.
    corner = rr.Transform3D(translation=[run.frames[0].x_px - 0.5, run.frames[0].y_px - 0.5, 0.0])
    columns = rr.EncodedImage.columns(blob=[png(frame.pixels) for frame in run.frames])
    return [
        once(at.CAMERA_FRAMES, corner, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-20.0)),
        columns_at(at.CAMERA_FRAMES, np.array([frame.t_us for frame in run.frames]), columns),
    ]


def surface_chunks(run: ViewedRun) -> list[Chunk]:
    """The whole surface in its own pixels, as the tracker searched it."""
    blank = np.zeros((run.camera.height_px, run.camera.width_px), np.uint8)
    blobs = [png(blank), *(png(tick.surface.values) for tick in run.ticks)]
    # Pixels are named by their centres: the image's corner lies half a pixel up and left of pixel (0, 0).
    corner = rr.Transform3D(translation=[-0.5, -0.5, 0.0])
    columns = rr.EncodedImage.columns(blob=blobs)
    return [
        once(at.SURFACE, corner, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
        columns_at(at.SURFACE, run.times_us, columns),
    ]


def track_chunks(run: ViewedRun) -> list[Chunk]:
    """Circles in the image, the place of what moves with the ball, and the tracker's status."""
    tracks = [tick.track for tick in run.ticks]
    kalman = [
        Circle(mean[0], mean[1], mean[4], 1.0) if ball else None
        for mean, ball in zip(run.means, run.has_ball, strict=True)
    ]
    statuses = ["searching", *(track.status for track in tracks)]
    circles = {"Hough": at.HOUGH_COLOUR, "refined": at.MEASURED_COLOUR, "Kalman": at.KALMAN_COLOUR}
    chunks = [
        *_circles(run, at.HOUGH, [track.hough for track in tracks], at.HOUGH_COLOUR, 0.8),
        *_circles(run, at.MEASURED, [track.measured for track in tracks], at.MEASURED_COLOUR, 1.2),
        *_circles(run, at.KALMAN, kalman, at.KALMAN_COLOUR, 1.6),
        *_balls(run),
        _ball_place(run),
        _names(run, at.CIRCLE_NAMES, circles | ({} if run.truth is None else {"truth": at.TRUTH_COLOUR})),
        *states(at.STATUS, run.times_us, statuses, at.STATUS_COLOURS),
    ]
    if run.true_states is not None:
        chunks += _true_circle(run, run.true_states)
    return chunks


def logo_chunks(run: ViewedRun) -> list[Chunk]:
    """Logo events around the ball's centre at their own time, with the outline and the edge of the mask."""
    logos = [tick.logo for tick in run.ticks]
    positions = [np.stack([logo.x_px, logo.y_px], axis=1) for logo in logos]
    classes = [2 + logo.events.on.astype(np.uint16) for logo in logos]
    arm = 0.05 * run.largest_radius_px
    cross = rr.LineStrips2D([[[-arm, 0], [arm, 0]], [[0, -arm], [0, arm]]], colors=[at.MASK_COLOUR], radii=[-0.7])
    return [
        once(at.BALL_CENTRE, cross),
        *_events(run, at.LOGO, positions, classes, radius_ui=2.0),
        *_rings(run, at.LOGO_OUTLINE, [logo.radius_px for logo in logos], at.KALMAN_COLOUR),
        *_rings(run, at.LOGO_MASK, [logo.radius_px - logo.pad_px for logo in logos], at.MASK_COLOUR),
    ]


def flow_chunks(run: ViewedRun) -> list[Chunk]:
    """Flow of Triplet Matching in the ball's frame, hue = direction, saturation = speed; and the wheel of colours."""
    half_px, bound_px_s = int(np.ceil(1.1 * run.largest_radius_px)), run.fast_flow_px_s or 1.0
    pictures = [
        hsv_image(
            tick.flow.events.x_px,
            tick.flow.events.y_px,
            tick.flow.vx_px_s,
            tick.flow.vy_px_s,
            bound_px_s=bound_px_s,
            radius_px=half_px + 0.5,
            size_px=2 * half_px + 1,
        )
        for tick in run.ticks
    ]
    blobs = [png(picture) for picture in (np.zeros_like(pictures[0]), *pictures)]
    corner = rr.Transform3D(translation=[-half_px - 0.5, -half_px - 0.5, 0.0])
    beside = rr.Transform3D(translation=[1.2 * half_px, -0.4 * half_px, 0.0], scale=0.8 * half_px / WHEEL_PX)
    speed = rr.Points2D(
        [[WHEEL_PX / 2, WHEEL_PX]], labels=[f"{bound_px_s / 1000:.1f} kpx/s"], colors=[at.MASK_COLOUR], show_labels=True
    )
    return [
        once(at.FLOW, corner, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
        columns_at(at.FLOW, run.times_us, rr.EncodedImage.columns(blob=blobs)),
        once(at.FLOW_WHEEL, beside, rr.EncodedImage(contents=_wheel(), media_type="image/png")),
        once(at.FLOW_SPEED, speed),
    ]


@cache
def _wheel() -> bytes:
    """PNG of the wheel of colours."""
    return png(hsv_wheel(WHEEL_PX))


def _are_among(events: EventBatch, others: EventBatch, start_us: int) -> NDArray[np.bool_]:
    """Flags (n,) of the events of a tick that are among others of it."""
    if not len(others):
        return np.zeros(len(events), np.bool_)
    keys, wanted = np.sort(_keys(others, start_us)), _keys(events, start_us)
    found: NDArray[np.bool_] = keys[np.minimum(keys.searchsorted(wanted), keys.size - 1)] == wanted
    return found


def _keys(events: EventBatch, start_us: int) -> NDArray[np.int64]:
    """One number an event by which two events of a tick are the same."""
    t, x, y, on = (getattr(events, name).astype(np.int64) for name in ("t_us", "x_px", "y_px", "on"))
    keys: NDArray[np.int64] = (((t - start_us) << 33) | (x << 17) | (y << 1)) | on
    return keys


def _events(
    run: ViewedRun,
    entity: str,
    positions: Sequence[NDArray[np.generic]],
    classes: Sequence[NDArray[np.uint16]],
    radius_ui: float,
) -> list[Chunk]:
    """Events of every tick as points in the colours of their classes."""
    columns = rr.Points2D.columns(
        positions=np.concatenate([np.empty((0, 2)), *positions]).astype(np.float32),
        class_ids=np.concatenate([np.empty(0, np.uint16), *classes]),
    )
    context = [rr.AnnotationInfo(i, name, colour) for i, (name, colour) in enumerate(at.EVENT_CLASSES)]
    style = rr.Points2D.from_fields(radii=[-radius_ui], show_labels=False)
    return [
        once(entity, rr.AnnotationContext(context), style),
        columns_at(entity, run.times_us, columns, [0, *map(len, classes)]),
    ]


def _circles(
    run: ViewedRun, entity: str, circles: Sequence[Circle | None], colour: at.Colour, width_ui: float
) -> list[Chunk]:
    """One circle a tick or none."""
    found = [circle for circle in circles if circle is not None]
    columns = rr.Ellipses2D.columns(
        centers=np.array([[c.x_px, c.y_px] for c in found], np.float32).reshape(-1, 2),
        half_sizes=np.array([[c.radius_px, c.radius_px] for c in found], np.float32).reshape(-1, 2),
    )
    lengths = [0, *(int(circle is not None) for circle in circles)]
    return [
        styled(entity, rr.Ellipses2D, colors=colour, line_radii=-width_ui),
        columns_at(entity, run.times_us, columns, lengths),
    ]


def _names(run: ViewedRun, entity: str, colours: dict[str, at.Colour]) -> Chunk:
    """Names in their colours along the image's upper edge."""
    columns = run.camera.width_px * (np.arange(len(colours)) + 0.5) / len(colours)
    places = np.column_stack([columns, np.zeros(len(colours))])
    return once(
        entity, rr.Points2D(places, labels=list(colours), colors=list(colours.values()), radii=-0.1, show_labels=True)
    )


def _balls(run: ViewedRun) -> list[Chunk]:
    """Circle of every ball with the number of its shot, and its track up to the tick."""
    so_far: dict[int, list[Floats]] = {}
    circles: list[tuple[Floats, str]] = []
    lines: list[Floats] = []
    lengths = [0]
    for tick in run.ticks:
        for ball in tick.track.balls:
            so_far.setdefault(ball.shot, []).append(ball.mean[:2])
            number = run.shot_numbers.get(ball.shot)
            circles.append((ball.mean, "" if number is None else str(number)))
            lines.append(np.array(so_far[ball.shot][-TRACK_TICKS:]))
        lengths.append(len(tick.track.balls))
    places = np.array([mean for mean, _ in circles]).reshape(-1, 5).astype(np.float32)
    outlines = rr.Ellipses2D.columns(
        centers=places[:, :2], half_sizes=places[:, [4, 4]] + BESIDE_PX, labels=[label for _, label in circles]
    )
    return [
        styled(at.BALLS, rr.Ellipses2D, colors=at.OTHERS_COLOUR, line_radii=-0.6, show_labels=True),
        columns_at(at.BALLS, run.times_us, outlines, lengths),
        styled(at.TRACKS, rr.LineStrips2D, colors=at.OTHERS_COLOUR, radii=-0.6),
        columns_at(at.TRACKS, run.times_us, rr.LineStrips2D.columns(strips=strips(lines)), lengths),
    ]


def _rings(run: ViewedRun, entity: str, radii_px: Sequence[float], colour: at.Colour) -> list[Chunk]:
    """A circle around the ball's own centre while there is a ball."""
    circles = [Circle(0.0, 0.0, radius, 1.0) if np.isfinite(radius) else None for radius in radii_px]
    return _circles(run, entity, circles, colour, 0.8)


def ball_places(run: ViewedRun) -> Floats:
    """Centre (n + 1, 2) of the ball at the start and each tick's end, px; the nearest known one while there is none."""
    known = np.flatnonzero(run.has_ball)
    if not known.size:
        return np.full((len(run.ticks) + 1, 2), (run.camera.width_px / 2, run.camera.height_px / 2))
    last = np.maximum(np.searchsorted(known, np.arange(-1, len(run.ticks)), side="right") - 1, 0)
    return run.means[known[last], :2]


def _ball_place(run: ViewedRun) -> Chunk:
    """Origin of the views in the ball's frame."""
    translation = np.column_stack([ball_places(run), np.zeros(len(run.ticks) + 1)])
    return columns_at(at.BALL_PLACE, run.times_us, rr.Transform3D.columns(translation=translation))


def _true_circle(run: ViewedRun, state: Floats) -> list[Chunk]:
    """The true outline, dashed."""
    angles = np.linspace(0, 2 * np.pi, 4 * DASHES, endpoint=False).reshape(DASHES, 4)[:, :3]
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    known = np.isfinite(state[:, 0])
    dashes = state[known, None, None, :2] + state[known, None, None, 4:] * unit
    columns = rr.LineStrips2D.columns(strips=strips(dashes.reshape(-1, *unit.shape[1:])))
    return [
        styled(at.TRUE_CIRCLE, rr.LineStrips2D, colors=at.TRUTH_COLOUR, radii=-0.8),
        columns_at(at.TRUE_CIRCLE, run.times_us, columns, [0, *(DASHES * known.astype(int))]),
    ]
