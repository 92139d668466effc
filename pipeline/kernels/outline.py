"""Outline of the ball in the events: the fit, and what supports it.

`circle`, `ellipticity` and tau_s as in `moving_circle`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Events, Flags, Floats, Integers
from .moving_circle import (
    WHOLE,
    box_around,
    box_within,
    fit_circle,
    in_box,
    near_outline,
    near_outline_of,
    relative_events,
    residuals,
)
from .order_statistics import value_of_rank

# Events used for a fit: beyond this the pixels' common errors outweigh the statistical, 0.1 px / sqrt(n).
MOST_EVENTS = 200
# Events looked at around a fitted outline, for what supports it.
MOST_AROUND = 400
# A fit seldom moves an outline, or changes its radius, by more.
MOVED_PX = 2.0
# Fewer are no outline.
LEAST_EVENTS, LEAST_WEIGHT = 12, 8.0
# A circle's scatter above this is no outline but a band of events.
MOST_SCATTER_PX = 0.5
# An event this near the fitted outline supports it: the scatter on clean outlines is 0.1-0.15 px, on a dim or
# textured scene three times as much.
ON_OUTLINE_PX = 1.2
# Behind, the ball's shading fires up to a fifth of the radius before the edge comes.
EARLY_SHARE = 0.2
SECTORS = 32
# Of the angles between the sectors of an eighth of a circle.
TANGENTS = tuple(math.tan(2.0 * math.pi * n / SECTORS) for n in range(1, SECTORS // 8))
# Where the motion passes an outline at a smaller |cos| than this, few events tell its place.
GRAZING = 0.25


@njit(cache=True, nogil=True)
def support(
    circle: Floats,
    ellipticity: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: Flags,
    width_px: int,
    height_px: int,
) -> Floats:
    """Support of a moving outline by events (n,) in an image of this size.

    On the outline = within ON_OUTLINE_PX of it, and behind the centre up to EARLY_SHARE of the radius inside. The
    outline is cut into SECTORS, which count from two events on, from one where there are fewer than three a sector;
    sectors that the motion passes at a grazing angle (|cos| < GRAZING) yield few events and do not count.

    Returns
    -------
    (8,) float64
        [events on the outline, share of ON among those ahead of the centre, the same behind it,
        share of the visible outline ahead that has events, the same behind it, share of the whole outline that is
        visible, events just outside (one to four ON_OUTLINE_PX beyond), events inside]. Shares of nothing are 0.
    """
    counts = np.zeros(SECTORS, np.int64)
    ahead_on, ahead, behind_on, behind, outside, inside = 0, 0, 0, 0, 0, 0
    error = residuals(circle, ellipticity, tau_s, x_px, y_px)
    for i in range(tau_s.size):
        if error[i] > ON_OUTLINE_PX:
            outside += error[i] < 4.0 * ON_OUTLINE_PX
            continue
        dx = x_px[i] - (circle[0] + circle[2] * tau_s[i])
        dy = y_px[i] - (circle[1] + circle[3] * tau_s[i])
        is_ahead = dx * circle[2] + dy * circle[3] > 0.0
        if error[i] < -(ON_OUTLINE_PX if is_ahead else max(ON_OUTLINE_PX, EARLY_SHARE * circle[4])):
            inside += 1
            continue
        if is_ahead:
            ahead += 1
            ahead_on += on[i]
        else:
            behind += 1
            behind_on += on[i]
        counts[_sector(dx, dy)] += 1
    speed = math.hypot(circle[2], circle[3]) + 1e-9
    least = 2 if ahead + behind >= 3 * SECTORS else 1
    seen, visible = np.zeros(2), np.zeros(2)
    in_view = 0
    for b in range(SECTORS):
        angle = 2.0 * math.pi * (b + 0.5) / SECTORS
        nx, ny = math.cos(angle), math.sin(angle)
        x, y = circle[0] + circle[4] * nx, circle[1] + circle[4] * ny
        if x < 0.0 or y < 0.0 or x > width_px - 1 or y > height_px - 1:
            continue
        in_view += 1
        across = (nx * circle[2] + ny * circle[3]) / speed
        if abs(across) < GRAZING:
            continue
        side = 0 if across > 0.0 else 1
        visible[side] += 1.0
        seen[side] += counts[b] >= least
    found = np.empty(8)  # set one by one: an array of a list takes seconds to compile
    found[0], found[1], found[2] = ahead + behind, ahead_on / max(ahead, 1), behind_on / max(behind, 1)
    found[3], found[4] = seen[0] / max(visible[0], 1.0), seen[1] / max(visible[1], 1.0)
    found[5], found[6], found[7] = in_view / SECTORS, outside, inside
    return found


@njit(cache=True, nogil=True)
def _sector(dx_px: float, dy_px: float) -> int:
    """Sector of SECTORS, by growing angle, in which this direction lies.

    By comparisons with the angles between them: with its arc tangent `support` takes twice as long.
    """
    across, down = abs(dx_px), abs(dy_px)
    near, far = min(across, down), max(across, down)
    step = 0
    for tangent in TANGENTS:
        step += near >= far * tangent
    if down > across:
        step = SECTORS // 4 - 1 - step
    if dx_px < 0.0:
        step = SECTORS // 2 - 1 - step
    return SECTORS - 1 - step if dy_px < 0.0 else step


@njit(cache=True, nogil=True)
def distance_behind(
    circle: Floats, ellipticity: Floats, tau_s: Floats, x_px: Floats, y_px: Floats, on: Flags, bright: bool
) -> float:
    """Median distance in px from a moving outline, > 0 outside, of those events (n,) that its half behind gives.

    They lie where the outline moves inwards, at no grazing angle, and are OFF if the disc is bright, else ON. NaN with
    fewer than LEAST_EVENTS.
    """
    error = residuals(circle, ellipticity, tau_s, x_px, y_px)
    least = GRAZING**2 * (circle[2] * circle[2] + circle[3] * circle[3])
    behind = np.empty(tau_s.size)
    m = 0
    for i in range(tau_s.size):
        dx = x_px[i] - (circle[0] + circle[2] * tau_s[i])
        dy = y_px[i] - (circle[1] + circle[3] * tau_s[i])
        across = dx * circle[2] + dy * circle[3]
        if on[i] != bright and across < 0.0 and across * across > least * (dx * dx + dy * dy):
            behind[m] = error[i]
            m += 1
    return value_of_rank(behind[:m], m // 2) if m >= LEAST_EVENTS else np.nan


@njit(cache=True, nogil=True)
def disc_events(circle: Floats, events: Events, reference_us: float) -> tuple[int, int]:
    """Number of events on the disc of a moving circle, its outline included, and within twice its radius."""
    t_us, x_px, y_px, _ = events
    disc, around = (circle[4] + ON_OUTLINE_PX) ** 2, (2.0 * circle[4]) ** 2
    on_disc, within = 0, 0
    for i in range(t_us.size):
        tau = (t_us[i] - reference_us) * 1e-6
        dx = x_px[i] - (circle[0] + circle[2] * tau)
        dy = y_px[i] - (circle[1] + circle[3] * tau)
        square = dx * dx + dy * dy
        on_disc += square <= disc
        within += square <= around
    return on_disc, within


@njit(cache=True, nogil=True)
def fit_outline(
    expected: Floats,
    prior_std: Floats,
    ellipticity: Floats,
    events: Events,
    reference_us: int,
    gate_px: float,
    part: int,
) -> tuple[Floats, Floats, float]:
    """Fit a part of the outline near an expected circle.

    Parameters
    ----------
    expected, prior_std, ellipticity : (5,), (5,), (2,) float64
        As for `fit_circle`.
    reference_us, gate_px : float
        Time of the expected circle; events within the gate of its outline take part.
    part : int
        Part of the outline that is fitted, see `near_outline`.

    Returns
    -------
    circle, covariance : (5,), (5, 5) float64
        NaN circle with too few events, or where these are a band rather than an outline.
    scatter_px : float
        1 sigma of the residuals.
    """
    chosen = near_outline(expected, events, reference_us, gate_px, MOST_EVENTS, part)
    return _fit_chosen(chosen, expected, prior_std, ellipticity, events, reference_us, gate_px)


@njit(cache=True, nogil=True)
def _fit_chosen(
    chosen: Integers,
    expected: Floats,
    prior_std: Floats,
    ellipticity: Floats,
    events: Events,
    reference_us: int,
    gate_px: float,
) -> tuple[Floats, Floats, float]:
    """`fit_outline` with the events chosen for it, (n,) int64."""
    nothing = np.full(5, np.nan), np.zeros((5, 5)), 0.0
    if chosen.size < LEAST_EVENTS:
        return nothing
    tau_s, x, y, _ = relative_events(chosen, events, reference_us)
    circle, covariance, scatter, weight = fit_circle(expected, prior_std, ellipticity, tau_s, x, y, gate_px, 0.6, 9)
    is_finite = True
    for k in range(5):
        is_finite &= math.isfinite(circle[k])
    if not (is_finite and circle[4] > 1.0 and weight >= LEAST_WEIGHT and scatter <= MOST_SCATTER_PX):
        return nothing
    return circle, covariance, scatter


@njit(cache=True, nogil=True)
def evidence(
    circle: Floats, ellipticity: Floats, events: Events, reference_us: int, width_px: int, height_px: int
) -> tuple[Floats, float]:
    """Support of a moving outline by the events, see `support`, and their distance behind, see `distance_behind`.

    The disc is taken for bright where more of the events ahead than of those behind are ON.
    """
    chosen = near_outline(circle, events, reference_us, _around_px(circle), MOST_AROUND, WHOLE)
    return _evidence_of(chosen, circle, ellipticity, events, reference_us, width_px, height_px)


@njit(cache=True, nogil=True)
def _around_px(circle: Floats) -> float:
    """Distance from an outline within which events are evidence for it."""
    around_px: float = max(4.0 * ON_OUTLINE_PX, EARLY_SHARE * circle[4])
    return around_px


@njit(cache=True, nogil=True)
def _evidence_of(
    chosen: Integers,
    circle: Floats,
    ellipticity: Floats,
    events: Events,
    reference_us: int,
    width_px: int,
    height_px: int,
) -> tuple[Floats, float]:
    """`evidence` of the events chosen for it, (n,) int64."""
    tau_s, x, y, on = relative_events(chosen, events, reference_us)
    found = support(circle, ellipticity, tau_s, x, y, on, width_px, height_px)
    return found, distance_behind(circle, ellipticity, tau_s, x, y, on, found[1] > found[2])


@njit(cache=True, nogil=True)
def ellipticity_at(x_px: float, y_px: float, optics_px: tuple[float, float, float]) -> Floats:
    """Departure (2,) from a circle of a sphere's outline around this pixel, see `moving_circle`.

    The semi-axes are as 1 to cos(theta), the longer one pointing away from the principal point (`Camera`). The optics
    are focal length and principal point.
    """
    focal_px, principal_x_px, principal_y_px = optics_px
    x, y = x_px - principal_x_px, y_px - principal_y_px
    square = x * x + y * y
    ellipticity = np.zeros(2)
    if square >= 1.0:
        ratio = math.sqrt(1.0 + square / (focal_px * focal_px))
        strength = (ratio - 1.0) / (ratio + 1.0) / square
        ellipticity[0], ellipticity[1] = (x * x - y * y) * strength, 2.0 * x * y * strength
    return ellipticity


@njit(cache=True, nogil=True)
def measured_outline(
    expected: Floats,
    prior_std: Floats,
    optics_px: tuple[float, float, float],
    events: Events,
    reference_us: int,
    gate_px: float,
    part: int,
    width_px: int,
    height_px: int,
) -> tuple[Floats, Floats, float, Floats, float]:
    """Outline by `fit_outline`, and its `evidence`, empty and NaN where there is none.

    The events around it are mostly looked for once for both.
    """
    ellipticity = ellipticity_at(expected[0], expected[1], optics_px)
    box = box_around(expected, events, reference_us, expected[4] + max(gate_px, _around_px(expected)) + MOVED_PX)
    around = in_box(events, box)
    chosen = near_outline_of(around, expected, events, reference_us, gate_px, MOST_EVENTS, part)
    circle, covariance, scatter_px = _fit_chosen(
        chosen, expected, prior_std, ellipticity, events, reference_us, gate_px
    )
    if math.isnan(circle[0]):
        return circle, covariance, scatter_px, np.empty(0), np.nan
    gate_px = _around_px(circle)
    new_box = box_around(circle, events, reference_us, circle[4] + gate_px)
    if not box_within(new_box, box):
        around = in_box(events, new_box)
    chosen = near_outline_of(around, circle, events, reference_us, gate_px, MOST_AROUND, WHOLE)
    found, behind_px = _evidence_of(chosen, circle, ellipticity, events, reference_us, width_px, height_px)
    return circle, covariance, scatter_px, found, behind_px
