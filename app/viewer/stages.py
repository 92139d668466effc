"""What each stage's column of results looks like: one function a stage, from a run to chunks.

Every result stands at the end of its tick, when it was known; the state it describes is older by the pixels'
latency (65 us or so). A first row at the start of the run says that nothing is known yet, so that no view is empty
wherever the playhead stands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pipeline.results import Circle
from pipeline.stages.flow import hsv_image, hsv_wheel

from . import entities as at
from .rerun_api import Chunk, band, columns_at, line, once, points, states
from .run import Run

Floats = NDArray[np.float64]

EVENTS_SHOWN = 1_500_000  # of more, every second, third ... is shown: 15 MB of points is what a flight may take
PNG_QUICK = [cv2.IMWRITE_PNG_COMPRESSION, 1]  # 3 times as fast as the default and 10 % larger on EROS surfaces
WHEEL_PX = 128
DASHES = 12


def filter_chunks(run: Run) -> list[Chunk]:
    """Raw events in the colours of their polarity, dimmed where the surface's filter took them out."""
    total = sum(len(tick.packet.events) for tick in run.ticks)
    keep_every = max(1, -(-total // EVENTS_SHOWN))
    positions, classes, lengths = [np.empty((0, 2), np.float32)], [np.empty(0, np.uint16)], [0]
    for tick in run.ticks:
        events, kept = tick.packet.events, tick.filter.surface_events
        chosen = slice(None, None, keep_every)
        x, y = events.x_px[chosen].astype(np.float32), events.y_px[chosen].astype(np.float32)
        is_kept = np.isin(_keys(events, tick.packet.start_us)[chosen], _keys(kept, tick.packet.start_us))
        positions.append(np.stack([x, y], axis=1))
        classes.append(2 * is_kept.astype(np.uint16) + events.on[chosen])
        lengths.append(x.size)
    counts = np.array(
        [[len(t.packet.events), len(t.filter.surface_events), len(t.filter.logo_events)] for t in run.ticks]
    )
    seconds = np.diff(run.times_us) * 1e-6
    names = ("all", "after the surface's filter", "after the logo's filter")
    colours = (at.TRUTH_COLOUR, at.KALMAN_COLOUR, at.MEASURED_COLOUR)
    rates = [
        line(f"{at.EVENT_COUNT}/{i}", run.times_us, _from_start(counts[:, i] / seconds / 1e6), f"{name} [Mev/s]", colour)
        for i, (name, colour) in enumerate(zip(names, colours, strict=True))
    ]  # fmt: skip
    context = [rr.AnnotationInfo(i, name, colour) for i, (name, colour) in enumerate(at.EVENT_CLASSES)]
    columns = rr.Points2D.columns(positions=np.concatenate(positions), class_ids=np.concatenate(classes))
    width, height = run.camera.width_px, run.camera.height_px
    frame = rr.Boxes2D(mins=[[-0.5, -0.5]], sizes=[[width, height]], colors=[at.MASK_COLOUR], radii=[-0.5])
    return [
        once(at.FRAME, frame),
        once(at.EVENTS, rr.AnnotationContext(context), rr.Points2D.from_fields(radii=[-1.0])),
        columns_at(at.EVENTS, run.times_us, columns, lengths),
        *(chunk for rate in rates for chunk in rate),
    ]


def surface_chunks(run: Run) -> list[Chunk]:
    """The surface as it was searched, whole, in its own pixels."""
    blank = np.zeros((run.camera.height_px, run.camera.width_px), np.uint8)
    blobs = [_png(blank), *(_png(tick.surface.values) for tick in run.ticks)]
    # Pixels are named by their centres: the image's corner lies half a pixel up and left of pixel (0, 0).
    corner = rr.Transform3D(translation=[-0.5, -0.5, 0.0])
    columns = rr.EncodedImage.columns(blob=blobs)
    return [
        once(at.SURFACE, corner, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
        columns_at(at.SURFACE, run.times_us, columns),
    ]


def track_chunks(run: Run) -> list[Chunk]:
    """Circles on the image, the ball's place for what moves with it, plots of the state, the tracker's status."""
    tracks = [tick.track for tick in run.ticks]
    kalman = [
        Circle(mean[0], mean[1], mean[4], 1.0) if ball else None
        for mean, ball in zip(run.means, run.has_ball, strict=True)
    ]
    statuses = ["searching", *(track.status for track in tracks)]
    chunks = [
        *_circles(run, at.HOUGH, [track.hough for track in tracks], at.HOUGH_COLOUR, 0.8),
        *_circles(run, at.MEASURED, [track.measured for track in tracks], at.MEASURED_COLOUR, 1.2),
        *_circles(run, at.KALMAN, kalman, at.KALMAN_COLOUR, 1.6),
        _ball_place(run),
        *states(at.STATUS, run.times_us, statuses, at.STATUS_COLOURS),
        *_state_plots(run),
        *_residual_plots(run),
    ]
    if run.truth is not None:
        chunks += _true_circle(run)
    return chunks


def logo_chunks(run: Run) -> list[Chunk]:
    """The logo's events around the ball's centre at their own time, with the outline and the mask's edge."""
    logos = [tick.logo for tick in run.ticks]
    positions = [np.stack([logo.x_px, logo.y_px], axis=1) for logo in logos]
    classes = [2 + logo.events.on.astype(np.uint16) for logo in logos]
    columns = rr.Points2D.columns(
        positions=np.concatenate([np.empty((0, 2)), *positions]).astype(np.float32),
        class_ids=np.concatenate([np.empty(0, np.uint16), *classes]),
    )
    context = [rr.AnnotationInfo(i, name, colour) for i, (name, colour) in enumerate(at.EVENT_CLASSES)]
    lengths = [0, *(len(logo.events) for logo in logos)]
    radii = [logo.radius_px for logo in logos]
    arm = 0.05 * run.largest_radius_px
    cross = rr.LineStrips2D([[[-arm, 0], [arm, 0]], [[0, -arm], [0, arm]]], colors=[at.MASK_COLOUR], radii=[-0.7])
    return [
        once(at.BALL_CENTRE, cross),
        once(at.LOGO, rr.AnnotationContext(context), rr.Points2D.from_fields(radii=[-2.0])),
        columns_at(at.LOGO, run.times_us, columns, lengths),
        *_rings(run, at.LOGO_OUTLINE, radii, at.KALMAN_COLOUR),
        *_rings(run, at.LOGO_MASK, [logo.radius_px - logo.pad_px for logo in logos], at.MASK_COLOUR),
    ]


def rate_chunks(run: Run) -> list[Chunk]:
    """Histogram of the event rate with its moving average, and the rhythm with its falling zero crossings."""
    t_us, curves, crossings_us = _rate_curves(run)
    zeros = np.where(np.isfinite(crossings_us), 0.0, np.nan)
    times = np.nan_to_num(crossings_us, nan=run.start_us)
    return [
        *line(f"{at.RATE}/histogram", t_us, curves[:, 0], "event rate [kev/s]", at.MASK_COLOUR, 1.0, steps=True),
        *line(f"{at.RATE}/ema", t_us, curves[:, 1], "moving average [kev/s]", at.HOUGH_COLOUR, 2.0),
        *line(f"{at.RHYTHM}/smooth", t_us, curves[:, 2], "less mean, low-passed [kev/s]", at.RATE_COLOUR, 2.0),
        *points(f"{at.RHYTHM}/crossings", times, zeros, "falls through zero", at.ON, "down", 5.0),
    ]


def flow_chunks(run: Run) -> list[Chunk]:
    """Triplet Matching's flow in the ball's frame: hue = direction, brightness = speed; and the wheel of colours."""
    half_px = int(np.ceil(1.1 * run.largest_radius_px))
    blank = np.zeros((2 * half_px + 1, 2 * half_px + 1, 3), np.uint8)
    pictures = [blank, *(hsv_image(tick.flow, half_px) for tick in run.ticks)]
    corner = rr.Transform3D(translation=[-half_px - 0.5, -half_px - 0.5, 0.0])
    beside = rr.Transform3D(translation=[1.2 * half_px, -0.4 * half_px, 0.0], scale=0.8 * half_px / WHEEL_PX)
    return [
        once(at.FLOW, corner, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
        columns_at(at.FLOW, run.times_us, rr.EncodedImage.columns(blob=[_png(p) for p in pictures])),
        once(at.FLOW_WHEEL, beside, rr.EncodedImage(contents=_png(hsv_wheel(WHEEL_PX)), media_type="image/png")),
    ]


def spin_chunks(run: Run) -> list[Chunk]:
    """Plots of each method's magnitude with its +-1 sigma, of the trusted vector, and of the axes' errors."""
    chunks: list[Chunk] = []
    for method in run.methods:
        estimates = [tick.spin.estimates[method] for tick in run.ticks]
        values = _from_start([_number(e.magnitude_rps) for e in estimates])
        stds = _from_start([_number(e.magnitude_std_rps) for e in estimates])
        entity, colour = f"{at.SPIN_MAGNITUDE}/{method}", at.method_colour(method)
        chunks += band(entity, run.times_us, values, np.nan_to_num(stds) ** 2, method, "rps", colour)
    rhythm = _from_start([_number(tick.rate.spin_rps) for tick in run.ticks])
    chunks += line(f"{at.SPIN_MAGNITUDE}/rate", run.times_us, rhythm, "rhythm of the event rate [rps]", at.RATE_COLOUR)
    vectors = np.full((len(run.ticks), 3), np.nan)
    for i, tick in enumerate(run.ticks):
        if tick.spin.best is not None:
            vectors[i] = tick.spin.estimates[tick.spin.best].vector_rps
    for i, (axis, colour) in enumerate(zip("xyz", (at.ON, at.KALMAN_COLOUR, at.OFF), strict=True)):
        values = _from_start(vectors[:, i])
        chunks += line(f"{at.SPIN_PARTS}/{axis}", run.times_us, values, f"{axis} [rps]", colour, 2.0)
    if run.truth is not None:
        chunks += _true_spin(run)
    return chunks


STAGES: tuple[Callable[[Run], list[Chunk]], ...] = (
    filter_chunks,
    surface_chunks,
    track_chunks,
    logo_chunks,
    rate_chunks,
    flow_chunks,
    spin_chunks,
)


def _keys(events: object, start_us: int) -> NDArray[np.int64]:
    """One number an event by which two events of a tick are the same."""
    t, x, y, on = (getattr(events, name).astype(np.int64) for name in ("t_us", "x_px", "y_px", "on"))
    keys: NDArray[np.int64] = (((t - start_us) << 33) | (x << 17) | (y << 1)) | on
    return keys


def _png(image: NDArray[np.uint8]) -> bytes:
    """A grey or RGB image as PNG."""
    ordered = image[..., ::-1] if image.ndim == 3 else image
    return bytes(cv2.imencode(".png", ordered, PNG_QUICK)[1])


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _from_start(values: Sequence[float] | Floats) -> Floats:
    """A column of ticks with the row before it, in which nothing is known."""
    return np.concatenate([[np.nan], np.asarray(values, np.float64)])


def _circles(
    run: Run, entity: str, circles: Sequence[Circle | None], colour: at.Colour, width_ui: float
) -> list[Chunk]:
    """One circle a tick or none."""
    found = [circle for circle in circles if circle is not None]
    columns = rr.Ellipses2D.columns(
        centers=np.array([[c.x_px, c.y_px] for c in found], np.float32).reshape(-1, 2),
        half_sizes=np.array([[c.radius_px, c.radius_px] for c in found], np.float32).reshape(-1, 2),
    )
    style = rr.Ellipses2D.from_fields(colors=[colour], line_radii=[-width_ui])
    lengths = [0, *(int(circle is not None) for circle in circles)]
    return [once(entity, style), columns_at(entity, run.times_us, columns, lengths)]


def _rings(run: Run, entity: str, radii_px: Sequence[float], colour: at.Colour) -> list[Chunk]:
    """A circle around the ball's own centre while there is a ball."""
    circles = [Circle(0.0, 0.0, radius, 1.0) if np.isfinite(radius) else None for radius in radii_px]
    return _circles(run, entity, circles, colour, 0.8)


def _ball_place(run: Run) -> Chunk:
    """The ball's centre, from which views in the ball's frame look; the nearest known one while there is no ball."""
    known = np.flatnonzero(run.has_ball)
    places = np.full((len(run.ticks) + 1, 2), (run.camera.width_px / 2, run.camera.height_px / 2))
    if known.size:
        last = np.maximum(np.searchsorted(known, np.arange(-1, len(run.ticks)), side="right") - 1, 0)
        places = run.means[known[last], :2]
    translation = np.column_stack([places, np.zeros(len(places))])
    return columns_at(at.BALL_PLACE, run.times_us, rr.Transform3D.columns(translation=translation))


def _state_plots(run: Run) -> list[Chunk]:
    """The Kalman state with its band, and what was measured as dots."""
    chunks: list[Chunk] = []
    for i, (name, unit) in enumerate(zip(at.QUANTITIES, at.UNITS, strict=True)):
        values, variances = _from_start(run.means[:, i]), _from_start(run.variances[:, i])
        entity = f"{at.PLOT}/{name}"
        chunks += band(
            f"{entity}/kalman", run.times_us, values, np.nan_to_num(variances), f"Kalman {name} ± 1σ", unit, at.KALMAN_COLOUR
        )  # fmt: skip
        if name in ("x", "y", "radius"):
            field = f"{name}_px"
            hough = _from_start([_measured(tick.track.hough, field, tick.track.has_ball) for tick in run.ticks])
            refined = _from_start([_measured(tick.track.measured, field, True) for tick in run.ticks])
            chunks += points(f"{entity}/hough", run.times_us, hough, f"Hough [{unit}]", at.HOUGH_COLOUR, "circle", 2.5)
            chunks += points(f"{entity}/measured", run.times_us, refined, f"refined [{unit}]", at.MEASURED_COLOUR, "circle", 3.0)  # fmt: skip
        if run.truth is not None:
            truth = _from_start(_true_state(run)[:, i])
            chunks += line(f"{entity}/truth", run.times_us, truth, f"truth [{unit}]", at.TRUTH_COLOUR, 0.8)
    return chunks


def _residual_plots(run: Run) -> list[Chunk]:
    """What was measured, and the truth, less the Kalman filter's value, in its band around zero."""
    chunks: list[Chunk] = []
    for i, name in ((0, "x"), (1, "y"), (4, "radius")):
        entity, mean = f"{at.RESIDUAL}/{name}", run.means[:, i]
        zero = _from_start(np.where(run.has_ball, 0.0, np.nan))
        variances = np.nan_to_num(_from_start(run.variances[:, i]))
        chunks += band(f"{entity}/kalman", run.times_us, zero, variances, "Kalman ± 1σ", "px", at.KALMAN_COLOUR)
        refined = [_measured(tick.track.measured, f"{name}_px", True) for tick in run.ticks] - mean
        chunks += points(f"{entity}/measured", run.times_us, _from_start(refined), "refined [px]", at.MEASURED_COLOUR)
        if run.truth is not None:
            truth = _from_start(_true_state(run)[:, i] - mean)
            chunks += line(f"{entity}/truth", run.times_us, truth, "truth [px]", at.TRUTH_COLOUR, 1.0)
    return chunks


def _measured(circle: Circle | None, field: str, shown: bool) -> float:
    return getattr(circle, field) if circle is not None and shown else float("nan")


def _true_state(run: Run) -> Floats:
    """(n, 5) the truth behind the Kalman states, at the scene's time."""
    assert run.truth is not None
    t_us = np.array([tick.track.t_us for tick in run.ticks])
    truth, seconds = run.truth, run.truth.t_us * 1e-6
    columns = [truth.x_px, truth.y_px, np.gradient(truth.x_px, seconds), np.gradient(truth.y_px, seconds)]
    return run.true_values(t_us, np.column_stack([*columns, truth.radius_px]))


def _true_circle(run: Run) -> list[Chunk]:
    """The true outline, dashed."""
    state = _true_state(run)
    angles = np.linspace(0, 2 * np.pi, 4 * DASHES, endpoint=False).reshape(DASHES, 4)[:, :3]
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    known = np.isfinite(state[:, 0])
    strips = [dash for row in state[known] for dash in row[:2] + row[4] * unit]
    columns = rr.LineStrips2D.columns(strips=strips)
    style = rr.LineStrips2D.from_fields(colors=[at.TRUTH_COLOUR], radii=[-0.8])
    return [
        once(at.TRUE_CIRCLE, style),
        columns_at(at.TRUE_CIRCLE, run.times_us, columns, [0, *(DASHES * known.astype(int))]),
    ]


def _true_spin(run: Run) -> list[Chunk]:
    assert run.truth is not None
    t_us = np.array([tick.track.t_us for tick in run.ticks])
    spin = run.true_values(t_us, run.truth.spin_rps)
    magnitude = np.linalg.norm(spin, axis=1)
    chunks = line(
        f"{at.SPIN_MAGNITUDE}/truth", run.times_us, _from_start(magnitude), "truth [rps]", at.TRUTH_COLOUR, 0.8
    )
    for method in run.methods:
        errors = np.full(len(run.ticks), np.nan)
        for i, tick in enumerate(run.ticks):
            axis = tick.spin.estimates[method].axis
            if axis is not None:
                errors[i] = np.degrees(np.arccos(np.clip(axis @ spin[i] / magnitude[i], -1, 1)))
        entity, colour = f"{at.AXIS_ERROR}/{method}", at.method_colour(method)
        chunks += line(entity, run.times_us, _from_start(errors), f"{method} [°]", colour)
    return chunks


def _rate_curves(run: Run) -> tuple[NDArray[np.int64], Floats, Floats]:
    """(n,) times, (n, 3) histogram, moving average and rhythm in 1000 events/s, (m,) crossings in us.

    Every tick tells the whole shot anew (its window's part): of each bin the latest word counts. A row of NaN
    leads, and parts the shots.
    """
    times, curves, crossings = [], [], []
    covered_us = np.inf
    for rate in (tick.rate for tick in reversed(run.ticks)):
        if not rate.t_us.size or rate.t_us[0] >= covered_us:
            continue
        new = rate.t_us < covered_us
        if rate.t_us[-1] < covered_us - 2 * (rate.t_us[-1] - rate.t_us[0]) / max(rate.t_us.size - 1, 1):
            times.append(rate.t_us[-1:] + 1)
            curves.append(np.full((1, 3), np.nan))
        values = np.column_stack([rate.rate_hz, rate.ema_hz, rate.smooth_hz]) / 1e3
        times.append(rate.t_us[new])
        curves.append(values[new])
        crossings.append(rate.crossings_us[rate.crossings_us < covered_us])
        covered_us = rate.t_us[0]
    if covered_us > run.start_us:
        times.append(np.array([run.start_us]))
        curves.append(np.full((1, 3), np.nan))
    found = np.concatenate([*crossings[::-1], np.empty(0)])
    return np.concatenate(times[::-1]), np.concatenate(curves[::-1]), found if found.size else np.array([np.nan])
