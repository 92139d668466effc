"""Panes of the viewer: single pictures, spaces and texts, of which the views are put together."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from . import entities as at
from .ball import EYE, path_bounds_m
from .derotated_logo import bounds as logo_bounds
from .run import ViewedRun
from .witnesses import bounds as witness_bounds

Floats = NDArray[np.float64]

CIRCLES = (at.HOUGH, at.MEASURED, at.KALMAN, at.TRUE_CIRCLE)
ALL_BALLS = (at.BALLS, at.TRACKS)
CLOSE_UP_RADII = 2.4  # half the width of a close-up: the ball with what moves near it


def picture(origin: str, name: str, contents: list[str] | None = None, bounds: Floats | None = None) -> rrb.View:
    """A picture; `bounds` ((2, 2), rows x and y from and to, px) are what is seen of it."""
    return rrb.Spatial2DView(
        origin=origin,
        contents=contents or "$origin/**",
        name=name,
        background=at.BACKGROUND,
        visual_bounds=None if bounds is None else rrb.VisualBounds2D(x_range=bounds[0], y_range=bounds[1]),
    )


def text(origin: str, name: str) -> rrb.View:
    """A text in Markdown."""
    return rrb.TextDocumentView(origin=origin, name=name)


def events(run: ViewedRun) -> rrb.View:
    """Raw events in the whole image, over the camera's own pictures where it took any."""
    contents = [at.FRAME, at.CAMERA_FRAMES, at.EVENTS, at.POLARITY_NAMES, *ALL_BALLS]
    return picture(at.IMAGE, "Events", contents, _image_bounds(run))


def surface(run: ViewedRun) -> rrb.View:
    """The surface with the circles and the names of their colours, in the whole image."""
    contents = [at.FRAME, at.SURFACE, at.CIRCLE_NAMES, *CIRCLES, *ALL_BALLS]
    return picture(at.IMAGE, "Surface", contents, _image_bounds(run))


def close_up(run: ViewedRun, name: str = "Close-up", prefix: str = "") -> rrb.View:
    """The surface with the circles around the ball, moving along with it."""
    contents = [prefix + path for path in (at.SURFACE, *CIRCLES)]
    return picture(prefix + at.BALL_PLACE, name, contents, _square(CLOSE_UP_RADII * run.largest_radius_px))


def logo_events(run: ViewedRun) -> rrb.View:
    """Events of the logo in the ball's frame."""
    contents = [at.BALL_CENTRE, at.LOGO, at.LOGO_OUTLINE, at.LOGO_MASK]
    return picture(at.BALL_PLACE, "Logo events", contents, _square(1.25 * run.largest_radius_px))


def flow(run: ViewedRun) -> rrb.View:
    """Flow in the ball's frame, beside the wheel of its colours."""
    bounds = run.largest_radius_px * np.array([[-1.2, 2.5], [-1.2, 1.2]])
    return picture(at.BALL_PLACE, "Flow", [at.FLOW, at.LOGO_OUTLINE, f"{at.FLOW_WHEEL}/**"], bounds)


def derotated_logo(name: str = "Derotated logo", prefix: str = "") -> rrb.View:
    """The logo with the spin taken out, both halves of the ball."""
    return picture(prefix + at.DEROTATED_LOGO, name, bounds=logo_bounds())


def score_over_magnitude() -> rrb.View:
    """Score of contrast over magnitudes along the best axis."""
    without = rrb.PlotLegend(visible=False)  # in a small pane it would hide the bars; the colours are the methods'
    return rrb.BarChartView(origin=at.SCORE_MAGNITUDE, name="Contrast over rps", plot_legend=without)


def witnesses() -> rrb.View:
    """Axis and magnitude that each witness tells."""
    return picture(at.WITNESSES, "Witnesses, 2 sigma", bounds=witness_bounds())


def status() -> rrb.View:
    """Lanes of the tracker's status and of the shots, one below the other for balls in flight at the same time."""
    return rrb.StateTimelineView(
        origin=at.TRACKER,
        name="Tracker and shots",
        time_view=rrb.TimeAxis(link="LinkToGlobal"),
    )


def contacts() -> rrb.View:
    """List of the contacts: which shot began or ended when, and how."""
    columns = rrb.TextLogColumns(timeline_columns=[at.TIMELINE], text_log_columns=["Body"])
    return rrb.TextLogView(origin=at.CONTACTS, name="Contacts", columns=columns)


def ball(run: ViewedRun, name: str = "Ball", *, methods: bool = True) -> rrb.View:
    """The ball from close by, from above the line of sight, moving along with it; with every method's arrow or not."""
    arrows = [at.SPIN_SHOWN, *([f"{at.SPIN_ARROWS}/**"] if methods else [])]
    return _space(
        at.BALL,
        name,
        [at.BALL, at.MESH, f"{at.SPIN_RING}/**", *arrows, at.PATH],
        _tilted(np.zeros(3), 5.5 * run.ball_radius_m),
        rrb.LineGrid3D(visible=False),
    )


def compared_axes(name: str) -> rrb.View:
    """Axes of two runs on a unit sphere, seen as the ball is."""
    return _space(at.COMPARED_AXES, name, ["$origin/**"], _tilted(np.zeros(3), 5.0), rrb.LineGrid3D(visible=False))


def difference(run: ViewedRun, name: str) -> rrb.View:
    """Difference of two runs' surfaces around the ball."""
    return picture(at.DIFFERENCE, name, bounds=_square(CLOSE_UP_RADII * run.largest_radius_px))


def flight(run: ViewedRun, name: str = "Flight path", hidden: tuple[str, ...] = ()) -> rrb.View:
    """The flight from above, tilted: right is the image's right, near is the image's lower edge."""
    low, high = path_bounds_m(run)
    middle, size_m = (low + high) / 2, max(float(np.linalg.norm(high - low)), 0.3)
    up = np.array(run.camera.up)
    below = min(float(low @ up), float(high @ up)) - 2 * run.ball_radius_m
    plane = rr.components.Plane3D(tuple(up), below)
    return _space(
        at.WORLD,
        name,
        [f"{at.WORLD}/**", *(f"- {path}" for path in (f"{at.SPIN_ARROWS}/**", *hidden))],
        _tilted(middle, 1.2 * size_m),
        rrb.LineGrid3D(visible=True, spacing=0.1, plane=plane, stroke_width=1.0),
    )


def _space(
    origin: str, name: str, contents: list[str], eye: rrb.EyeControls3D, grid: rrb.LineGrid3D
) -> rrb.Spatial3DView:
    """A space in which the path stays up to the playhead."""
    so_far = rrb.VisibleTimeRanges(
        timeline=at.TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        background=at.BACKGROUND,
        line_grid=grid,
        eye_controls=eye,
        overrides={at.PATH: so_far},
    )


def _tilted(target: Floats, distance_m: float) -> rrb.EyeControls3D:
    """Eye that looks at the target as the camera does, tilted towards the image's lower edge."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + distance_m * EYE,
        look_target=target,
        eye_up=(0.0, EYE[2], -EYE[1]),
    )


def _image_bounds(run: ViewedRun) -> Floats:
    return np.array([[-0.5, run.camera.width_px - 0.5], [-0.5, run.camera.height_px - 0.5]])


def _square(half_px: float) -> Floats:
    return np.array([[-half_px, half_px], [-half_px, half_px]])
