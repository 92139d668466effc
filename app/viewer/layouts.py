"""The blueprint: five tabs over the same data, in slow motion, paused where the track starts."""

from __future__ import annotations

from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from . import LAYOUTS
from . import entities as at
from .ball import EYE, path_bounds_m
from .plots import true_state
from .run import ViewedRun
from .summary import CARD_PX

Floats = NDArray[np.float64]

HEADROOM = 0.5  # of a plot's range, for its legend
SLOW_MOTION = 0.01  # a flight of 100 ms plays for 10 s
NAMES = {
    "all": "All stages",
    "tracker": "Tracker",
    "logo": "Logo and flow",
    "spin": "Spin",
    "coach": "Coach",
}


def blueprint(run: ViewedRun, layout: str, *, is_lasting: bool = False) -> rrb.Blueprint:
    """All tabs, with the one of `layout` (a key of NAMES) in front. Played over and over is the first shot.

    is_lasting : other recordings are to be shown with it: all of each is played, for the viewer forgets the selection
    """
    makers = {"all": _all, "tracker": _tracker, "logo": _logo, "spin": _spin, "coach": _coach}
    tabs = [makers[name](run) for name in LAYOUTS]
    end_us = run.shots[0].end_us if run.shots else run.end_us
    shot = rrb.components.AbsoluteTimeRange(min=run.first_sight_us * 1000, max=end_us * 1000)
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=LAYOUTS.index(layout)),
        rrb.TopPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=at.TIMELINE,
            playback_speed=SLOW_MOTION,
            play_state="paused",
            loop_mode="all" if is_lasting else "selection",
            time_selection=None if is_lasting else shot,
        ),
        auto_layout=False,
        auto_views=False,
    )


def _all(run: ViewedRun) -> rrb.Container:
    return rrb.Vertical(
        rrb.Horizontal(_events(run), _surface(run), _close_up(run), _space(run), column_shares=[4, 4, 3, 3]),
        rrb.Horizontal(
            rrb.Vertical(_status(), _state_tabs(run), row_shares=[3, 5]),
            _logo_events(run),
            _flow(run),
            _still(),
            column_shares=[4, 3, 3, 4],
        ),
        rrb.Horizontal(_rate(run, legend=False), _magnitude(run), _ball(run), _summary(), column_shares=[4, 4, 3, 5]),
        row_shares=[4, 4, 5],
        name=NAMES["all"],
    )


def _tracker(run: ViewedRun) -> rrb.Container:
    colours = "Surface: Hough yellow, refined orange, Kalman green"
    if run.truth is not None:
        colours += ", truth violet"
    return rrb.Horizontal(
        rrb.Vertical(
            _surface(run, colours),
            rrb.Horizontal(_close_up(run), _events(run), column_shares=[2, 3]),
            row_shares=[3, 2],
        ),
        rrb.Vertical(_status(), *(_state_plot(run, name) for name in at.QUANTITIES), row_shares=[1.2, 2, 2, 2, 2, 2]),
        rrb.Vertical(*(_residual(run, name) for name in ("x", "y", "radius")), _event_count(run)),
        column_shares=[5, 4, 3],
        name=NAMES["tracker"],
    )


def _logo(run: ViewedRun) -> rrb.Container:
    return rrb.Horizontal(
        rrb.Vertical(_logo_events(run), _close_up(run)),
        rrb.Vertical(_flow(run), _still()),
        rrb.Vertical(_rate(run), _rhythm(run), _magnitude(run)),
        column_shares=[3, 4, 4],
        name=NAMES["logo"],
    )


def _spin(run: ViewedRun) -> rrb.Container:
    plots = [_magnitude(run), _parts(run)]
    if run.truth is not None:
        plots.append(_axis_error())
    return rrb.Horizontal(
        rrb.Vertical(_ball(run), _unrolled(), row_shares=[3, 2]),
        rrb.Vertical(_score_over_magnitude(), _score_over_axes(), row_shares=[4, 3]),
        rrb.Vertical(*plots),
        _summary(),
        column_shares=[4, 4, 3, 4],
        name=NAMES["spin"],
    )


def _coach(run: ViewedRun) -> rrb.Container:
    return rrb.Horizontal(
        _ball(run, "Ball and spin", [at.SPIN_SHOWN]),
        rrb.Vertical(_card(), _space(run, "Flight", [at.AXES, at.TRUE_PATH, at.SPIN_SHOWN]), row_shares=[3, 2]),
        column_shares=[3, 2],
        name=NAMES["coach"],
    )


def _image_view(run: ViewedRun, name: str, contents: list[str]) -> rrb.Spatial2DView:
    width, height = run.camera.width_px, run.camera.height_px
    bounds = rrb.VisualBounds2D(x_range=[-0.5, width - 0.5], y_range=[-0.5, height - 0.5])
    return rrb.Spatial2DView(
        origin=at.IMAGE, contents=contents, name=name, background=at.BACKGROUND, visual_bounds=bounds
    )


def _ball_view(run: ViewedRun, name: str, contents: list[str], radii: float) -> rrb.Spatial2DView:
    """A view that moves with the ball and shows that many radii around it."""
    half = radii * run.largest_radius_px
    bounds = rrb.VisualBounds2D(x_range=[-half, half], y_range=[-half, half])
    return rrb.Spatial2DView(
        origin=at.BALL_PLACE, contents=contents, name=name, background=at.BACKGROUND, visual_bounds=bounds
    )


CIRCLES = [at.HOUGH, at.MEASURED, at.KALMAN, at.TRUE_CIRCLE]


def _events(run: ViewedRun) -> rrb.View:
    return _image_view(run, "Raw events: ON red, OFF blue", [at.FRAME, at.EVENTS])


def _surface(run: ViewedRun, name: str = "Surface: Hough yellow, Kalman green") -> rrb.View:
    return _image_view(run, name, [at.FRAME, at.SURFACE, *CIRCLES])


def _close_up(run: ViewedRun) -> rrb.View:
    return _ball_view(run, "Surface around the ball", [at.SURFACE, *CIRCLES], 2.4)


def _logo_events(run: ViewedRun) -> rrb.View:
    contents = [at.BALL_CENTRE, at.LOGO, at.LOGO_OUTLINE, at.LOGO_MASK]
    return _ball_view(run, "Logo events in the ball's frame", contents, 1.25)


def _flow(run: ViewedRun) -> rrb.View:
    speed = "" if run.fast_flow_px_s is None else f": full colour = {run.fast_flow_px_s:,.0f} px/s"
    view = _ball_view(run, f"Flow{speed}", [at.FLOW, at.LOGO_OUTLINE, at.FLOW_WHEEL], 1.25)
    radius = run.largest_radius_px
    view.properties["VisualBounds2D"] = rrb.VisualBounds2D(
        x_range=[-1.2 * radius, 2.3 * radius], y_range=[-1.2 * radius, 1.2 * radius]
    )
    return view


def _still() -> rrb.View:
    name = "Spin taken out: logo stands still"
    return rrb.Spatial2DView(origin=at.STILL_LOGO, name=name, background=at.BACKGROUND)


def _unrolled() -> rrb.View:
    name = "Logo unrolled about the axis, grid 90°"
    return rrb.Spatial2DView(origin=at.UNROLLED, name=name, background=at.BACKGROUND)


def _score_over_magnitude() -> rrb.View:
    corner = rrb.PlotLegend(corner="LeftTop")  # the top is in the middle
    return rrb.BarChartView(origin=at.SCORE_MAGNITUDE, name="Score over magnitude [rps]", plot_legend=corner)


def _score_over_axes() -> rrb.View:
    name = "Score over axes: towards camera, away"
    return rrb.Spatial2DView(origin=at.SCORE_AXES, name=name, background=at.BACKGROUND)


def _plot(
    origin: str,
    name: str,
    y_range: tuple[float, float] | None = None,
    legend: bool = False,
    corner: Literal["RightTop", "RightBottom"] = "RightTop",
) -> rrb.TimeSeriesView:
    """A plot over the time in view; with a legend the range grows upwards to make room for it."""
    if legend and y_range is not None:
        y_range = (y_range[0], y_range[1] + HEADROOM * (y_range[1] - y_range[0]))
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=None if y_range is None else rrb.ScalarAxis(range=y_range),
        plot_legend=rrb.PlotLegend(corner=corner, visible=legend or corner == "RightBottom"),
    )


def _status() -> rrb.View:
    return rrb.StateTimelineView(
        origin=at.STATUS, name="State of the tracker", time_view=rrb.TimeAxis(link="LinkToGlobal")
    )


def _state_plot(run: ViewedRun, name: str) -> rrb.View:
    column = at.QUANTITIES.index(name)
    titles = {"x": "x", "y": "y", "vx": "Velocity x", "vy": "Velocity y", "radius": "Radius"}
    deviation = np.sqrt(run.variances[:, column])
    values = [run.means[:, column] - deviation, run.means[:, column] + deviation]
    if name in ("x", "y", "radius"):
        for kind in ("hough", "measured"):
            circles = [getattr(tick.track, kind) for tick in run.ticks if tick.track.has_ball]
            values.append(np.array([getattr(c, f"{name}_px") for c in circles if c is not None]))
    return _plot(f"{at.PLOT}/{name}", f"{titles[name]} [{at.UNITS[column]}]", _range(np.concatenate(values)))


def _state_tabs(run: ViewedRun) -> rrb.Container:
    return rrb.Tabs(*(_state_plot(run, name) for name in at.QUANTITIES), active_tab=0)


def _residual(run: ViewedRun, name: str) -> rrb.View:
    column = at.QUANTITIES.index(name)
    deviation, mean = np.sqrt(run.variances[:, column]), run.means[:, column]
    values = [deviation, -deviation]
    values.append(np.array([getattr(tick.track.measured, f"{name}_px", np.nan) for tick in run.ticks]) - mean)
    if run.truth is not None:
        values.append(true_state(run)[:, column] - mean)
    return _plot(f"{at.RESIDUAL}/{name}", f"{name} less Kalman [px]", _range(np.concatenate(values)))


def _event_count(run: ViewedRun) -> rrb.View:
    rates = [len(t.packet.events) / (t.packet.end_us - t.packet.start_us) for t in run.ticks]
    return _plot(at.EVENT_COUNT, "Event rate [Mev/s]", _range(np.array([0.0, *rates])), legend=True)


def _rate(run: ViewedRun, legend: bool = True) -> rrb.View:
    rates = [0.0, *(tick.rate.rate_hz.max(initial=0.0) / 1e3 for tick in run.ticks)]
    return _plot(at.RATE, "Logo's event rate [kev/s], average yellow", _range(np.array(rates)), legend)


def _rhythm(run: ViewedRun) -> rrb.View:
    rates = [tick.rate.smooth_hz / 1e3 for tick in run.ticks]
    name = "Rhythm of the rate [kev/s] and its falling zero crossings"
    return _plot(at.RHYTHM, name, _range(np.concatenate(rates)), legend=True)


def _magnitude(run: ViewedRun) -> rrb.View:
    values = [e.magnitude_rps for tick in run.ticks for e in tick.estimates.values()]
    values += [tick.rate.spin_rps for tick in run.ticks]
    known = np.array([value for value in values if value is not None])
    top = 1.2 * float(np.quantile(known, 0.95)) if known.size else 100.0
    if run.truth is not None:
        top = max(top, 1.2 * float(np.linalg.norm(run.truth.spin_rps, axis=1).max()))
    return _plot(at.SPIN_MAGNITUDE, "Spin [rps] ± 1σ", (0.0, top), corner="RightBottom")


def _parts(run: ViewedRun) -> rrb.View:
    trusted = [t.estimates[t.best].vector_rps for t in run.ticks if t.best is not None]
    y_range = _range(np.concatenate([np.zeros(1), *(vector for vector in trusted if vector is not None)]))
    return _plot(at.SPIN_PARTS, "Trusted spin vector, camera frame [rps]", y_range, legend=True)


def _axis_error() -> rrb.View:
    return _plot(at.AXIS_ERROR, "Angle between axis and truth [°]", (0.0, 40.0), legend=True)


def _summary() -> rrb.View:
    return rrb.TextDocumentView(origin=at.SUMMARY, name="Summary")


def _card() -> rrb.View:
    bounds = rrb.VisualBounds2D(x_range=[0, CARD_PX], y_range=[0, CARD_PX])
    return rrb.Spatial2DView(origin=at.COACH, name="Shot", background=at.BACKGROUND, visual_bounds=bounds)


def _range(values: Floats) -> tuple[float, float] | None:
    """The values' range with a tenth to spare on either side; None for no values."""
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    low, high = float(known.min()), float(known.max())
    spare = 0.1 * (high - low) or 1.0
    return low - spare, high + spare


def _ball(run: ViewedRun, name: str = "Ball, logo painted on", arrows: list[str] | None = None) -> rrb.View:
    """The ball from close by, from above the line of sight; moving along with it. Without `arrows`: all of them."""
    shown = arrows or [at.SPIN_SHOWN, f"{at.SPIN_ARROWS}/**"]
    eye = _tilted(np.zeros(3), 5.5 * run.ball_radius_m)
    return rrb.Spatial3DView(
        origin=at.BALL,
        contents=[at.BALL, at.MESH, f"{at.SPIN_RING}/**", *shown, at.PATH],
        name=name,
        background=at.BACKGROUND,
        line_grid=False,
        eye_controls=eye,
        overrides={at.PATH: _so_far()},
    )


def _space(run: ViewedRun, name: str = "Flight path, grid 0.1 m", without: list[str] | None = None) -> rrb.View:
    """The flight from above, tilted: right is the image's right, near is the image's lower edge."""
    hidden = [f"- {path}" for path in (f"{at.SPIN_ARROWS}/**", *(without or []))]
    low, high = path_bounds_m(run)
    middle, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), 0.3)
    up = np.array(run.camera.up)
    below = min(float(low @ up), float(high @ up)) - 2 * run.ball_radius_m
    return rrb.Spatial3DView(
        origin=at.WORLD,
        contents=[f"{at.WORLD}/**", *hidden],
        name=name,
        background=at.BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True, spacing=0.1, plane=rr.components.Plane3D(tuple(up), below), stroke_width=1.0
        ),
        eye_controls=_tilted(middle, 1.2 * size),
        overrides={at.PATH: _so_far()},
    )


def _tilted(target: Floats, distance_m: float) -> rrb.EyeControls3D:
    """Look at the target as the camera does, tilted towards the image's lower edge."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + distance_m * EYE,
        look_target=target,
        eye_up=(0.0, EYE[2], -EYE[1]),
    )


def _so_far() -> rrb.VisibleTimeRanges:
    """Everything up to the playhead: the path keeps its earlier pieces."""
    return rrb.VisibleTimeRanges(
        timeline=at.TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
