"""Input and output of contrast maximisation: events on the sphere and their windows, the ball, estimate and result."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numba
import numpy as np

from ...kernels.arrays import Flags, Floats, Integers
from ...results import ReadOnlyArrays, SpinEstimate

GOLDEN_RATIO = 0.6180339887498949  # its multiples modulo 1 spread as evenly as any sequence can
# Log odds of a candidate against one that it beats by one sigma: of 307 pairs of maxima, one of them the truth, on 95
# simulated flights and spinners, as they grew, the likeliest are 1.65 (near maxima) and 2.45 (far ones).
LOG_ODDS_PER_SIGMA = 1.7
# No spin is less likely than this against the best one: of 190 answers on simulated flights and spinners none was
# grossly wrong, so that up to 3 in 190 may be (rule of three, 95 %).
UNEXPLAINED = math.log(3.0 / 190.0)
# ON and OFF, bright and dark pixels report 25 us sooner or later than the mean latency: what the ball flies meanwhile
# is an error of its place that the tracker, which sees the outline, does not know of.
LATENCY_SPREAD_S = 25e-6
# What the events are, turned back by the best spin. `none`: chance brings as many together; `unclear`: they come
# together, but may be a slow sensor's outline, or visits of the logo that do not fit together, and tell neither its
# motion nor when it was seen; `off_rhythm`: the pattern comes back, but not with its spin, so that neither of the two
# tells the spin; `turning`: one pattern that turns, and nothing puts it in doubt.
Pattern = Literal["none", "unclear", "off_rhythm", "turning"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContrastSettings:
    """Numbers of `estimate_spin`.

    Attributes
    ----------
    fastest_rps : float
        The highest magnitude looked for.
    sigma_rad : float
        Kernel of the refinement; 1.5 and 2 times that for what leads up to it. A pixel of a 17 px ball is 0.06 rad;
        pixels report within about 0.1 ms, 0.03 rad at 50 rps.
    floor : float
        Density in coinciding events, see `score`.
    refine_events, search_events, scan_events, follow_events, rival_events : int
        Events looked at by the refinement, the grid search, the alias scan, `follow_spin` and the rivals' covariances.
    score_weight : float
        Weight of the score against the assumed place of the ball.
    repeats : float
        Number of events that tell the same (the events of one edge at one pixel and its neighbours).
    """

    fastest_rps: float = 170.0
    sigma_rad: float = 0.04
    floor: float = 1.5
    min_events: int = 40
    refine_events: int = 3000
    search_events: int = 800
    scan_events: int = 250
    follow_events: int = 1000
    rival_events: int = 500
    score_weight: float = 0.1
    repeats: float = 8.0


class EventColumns(NamedTuple):
    """Events in segments, as the kernels take them; only events of one segment are compared with each other.

    Attributes
    ----------
    t_s, normals, polarity
        As of `SphereEvents`; rising within a segment, from the reference time on.
    starts : (k + 1,) int64
        Index of each segment's first event, and n.
    """

    t_s: Floats
    normals: Floats
    polarity: Integers
    starts: Integers


class ScoreWindow(NamedTuple):
    """Events, and the same events at other times of their segment: `permuted` holds those of index `rows` (m,).

    Attributes
    ----------
    apart_s : float
        Events no farther apart in time than this are not compared with each other; 0: each with all others.
    """

    events: EventColumns
    permuted: EventColumns
    rows: Integers
    apart_s: float


@dataclass(frozen=True, slots=True, eq=False)
class SphereEvents:
    """The logo's events of one stretch of time, on the ball.

    Attributes
    ----------
    t_s : (n,) float64
        Rising, any origin.
    normals : (3, n) float64
        Outward unit normals where the events are on the ball, camera frame.
    polarity : (n,) int64
        0 OFF, 1 ON.
    facing : (3, n) float64
        Unit vectors from the camera to the ball's centre.
    radius_px : (n,) float64
        Radius of the ball.
    """

    t_s: Floats
    normals: Floats
    polarity: Integers
    facing: Floats
    radius_px: Floats

    def __len__(self) -> int:
        return self.t_s.size

    def at(self, rows: Integers | Flags) -> SphereEvents:
        """Select the events of a mask or of indices."""
        normals, facing = (np.ascontiguousarray(table[:, rows]) for table in (self.normals, self.facing))
        return SphereEvents(self.t_s[rows], normals, self.polarity[rows], facing, self.radius_px[rows])

    def thinned(self, count: int) -> SphereEvents:
        """Take every k-th event, so that about `count` are left."""
        stride = max(1, round(len(self) / count))
        return self if stride == 1 else self.at(np.arange(0, len(self), stride))

    @property
    def columns(self) -> EventColumns:
        """All events as one segment."""
        return EventColumns(self.t_s, self.normals, self.polarity, np.array([0, len(self)]))

    @property
    def patch_rad(self) -> float:
        """Spread of the events over the ball as it is seen: root mean square from their middle."""
        middle = self.normals.mean(axis=1)
        return float(np.sqrt(max(0.0, 1.0 - middle @ middle)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BallUncertainty:
    """1 sigma of the ball's assumed place.

    Attributes
    ----------
    centre_std_px, radius_std_px : float
        Of the centre (one axis) and the radius, as constant errors over the stretch.
    track_std_px, drift_std_px_s : float
        Of the centre's changes within the stretch, and the most it can drift.
    speed_px_s : float
        Speed of the centre itself (no uncertainty): what an edge moves with besides the spin.
    """

    centre_std_px: float
    radius_std_px: float
    track_std_px: float = 0.0
    drift_std_px_s: float = 0.0
    speed_px_s: float = 0.0

    @property
    def is_flying(self) -> bool:
        """Whether the ball moves; one on a spinner stays in place."""
        return self.speed_px_s > 0.0

    @property
    def latency_std_px(self) -> float:
        """Way of the centre in the time by which the logo's events come sooner or later than one another."""
        return self.speed_px_s * LATENCY_SPREAD_S


@dataclass(frozen=True, slots=True, eq=False)
class ContrastEstimate:
    """Best spin of some events, its uncertainty and its rivals.

    Attributes
    ----------
    spin_rps, covariance_rps2 : (3,) and (3, 3) float64, or None
        The best spin and its 1-sigma covariance, camera frame; None with too few events.
    events : int
        Number of events given.
    reference_s, span_s : float
        Middle of the stretch, to whose time the events are derotated, and its length.
    rivals_rps, rival_covariances_rps2, margins : (k, 3), (k, 3, 3) and (k,) float64
        Other local maxima of the score, their covariances, and by how many sigmas they are lower.
    kept_rps2 : (3, 3) float64
        Part of the covariance that only a full estimate finds: near rivals and the distance of the polarities' maxima.
    offsets_px : (3,) float64
        Refined centre x, y and radius less the assumed ones.
    contrast : float
        Score per event less that of permuted times; 0 = no pattern turns with the spin.
    patch_rad : float
        See `SphereEvents`.
    linked_share : float
        Stretch over which the events confirm the spin, as a share of that over which there are events.
    """

    spin_rps: Floats | None
    covariance_rps2: Floats | None
    events: int
    reference_s: float = 0.0
    span_s: float = 0.0
    rivals_rps: Floats = field(default_factory=lambda: np.empty((0, 3)))
    rival_covariances_rps2: Floats = field(default_factory=lambda: np.empty((0, 3, 3)))
    margins: Floats = field(default_factory=lambda: np.empty(0))
    kept_rps2: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    offsets_px: Floats = field(default_factory=lambda: np.zeros(3))
    contrast: float = 0.0
    patch_rad: float = 0.0
    linked_share: float = 1.0

    @property
    def turns(self) -> float:
        """Number of turns within the stretch; 0 without a spin."""
        return 0.0 if self.spin_rps is None else self.span_s * float(np.linalg.norm(self.spin_rps))


class ScoreMap(NamedTuple):
    """Score per event around an estimate, for people to look at.

    Attributes
    ----------
    magnitudes_rps, magnitude_scores : (m,) float64
        Along the estimate's axis.
    directions, direction_scores : (d, 3) and (d,) float64
        Over all axes at the estimate's magnitude.
    """

    magnitudes_rps: Floats
    magnitude_scores: Floats
    directions: Floats
    direction_scores: Floats

    @classmethod
    def empty(cls) -> ScoreMap:
        """Nothing to show."""
        return cls(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class ContrastResult(ReadOnlyArrays):
    """The estimate from the present shot so far, and what it rests on.

    Attributes
    ----------
    best_rps, covariance_rps2 : (3,) and (3, 3) float64
        The best spin and its covariance, also of a refused answer; NaN without one.
    rivals_rps, rival_covariances_rps2 : (k, 3) and (k, 3, 3) float64
        Other tops of the score, and their covariances.
    rival_sigmas : (k,) float64
        By how many standard deviations the best one beats each.
    start_us, end_us : int
        Stretch of the events used (event time); 0, 0 without events.
    reference_us : float
        The event time to which the events are turned back.
    offsets_px : (3,) float64
        Centre x, y and radius of the ball, refined less tracked.
    contrast : float
        Score an event less that of permuted times; 0 = nothing turns with the spin.
    pattern : Pattern
        What the events are, turned back by the best spin; where it is not `turning`, no spin is likelier.
    changes : bool
        Whether the spin changes within the flight: a contact was missed, and no estimate from all of it holds.
    full : bool
        Whether this tick made a full estimate, or followed the last one.
    magnitudes_rps, magnitude_scores : (m,) float64
        The score an event along the best axis, at the last full estimate.
    directions, direction_scores : (d, 3) and (d,) float64
        The same over all axes at the best magnitude.
    """

    estimate: SpinEstimate
    best_rps: Floats
    covariance_rps2: Floats
    rivals_rps: Floats
    rival_covariances_rps2: Floats
    rival_sigmas: Floats
    start_us: int
    end_us: int
    reference_us: float
    offsets_px: Floats
    contrast: float
    pattern: Pattern
    changes: bool
    full: bool
    magnitudes_rps: Floats
    magnitude_scores: Floats
    directions: Floats
    direction_scores: Floats

    @classmethod
    def nothing(cls, estimate: SpinEstimate) -> ContrastResult:
        """Nothing to see of a shot."""
        return cls(
            estimate=estimate,
            best_rps=np.full(3, np.nan),
            covariance_rps2=np.full((3, 3), np.nan),
            rivals_rps=np.empty((0, 3)),
            rival_covariances_rps2=np.empty((0, 3, 3)),
            rival_sigmas=np.empty(0),
            start_us=0,
            end_us=0,
            reference_us=math.nan,
            offsets_px=np.zeros(3),
            contrast=0.0,
            pattern="none",
            changes=False,
            full=False,
            **ScoreMap.empty()._asdict(),
        )

    def log_likelihood(self, spins_rps: Floats) -> Floats:
        """Log likelihood of spins, less that of the best one.

        Parameters
        ----------
        spins_rps : (m, 3) float64
            Camera frame.

        Returns
        -------
        (m,) float64
            Zero throughout where no pattern is seen to turn; nowhere below that of an answer grossly wrong.

        Notes
        -----
        Each candidate counts with its height, LOG_ODDS_PER_SIGMA for each sigma by which the best one beats it, and
        falls off around it as its covariance says; the largest of them holds. A pattern that stands still is a
        candidate as any other: the score is zero there (it compares with permuted times), and so the best spin's lead
        over it is `contrast` times the number of events.
        """
        spins_rps = np.asarray(spins_rps, np.float64).reshape(-1, 3)
        if self.pattern != "turning":
            return np.zeros(len(spins_rps))
        heights = -LOG_ODDS_PER_SIGMA * np.concatenate([[0.0], self.rival_sigmas])
        means = np.concatenate([self.best_rps[None], self.rivals_rps])
        precisions = np.linalg.inv(np.concatenate([self.covariance_rps2[None], self.rival_covariances_rps2]))
        off = spins_rps[:, None] - means
        values = heights - 0.5 * np.einsum("mki,kij,mkj->mk", off, precisions, off)
        likeliest: Floats = np.maximum(values.max(axis=1), UNEXPLAINED)
        return likeliest


@numba.njit(cache=True, nogil=True)
def time_permuted(events: EventColumns, times_each: int) -> tuple[EventColumns, Integers]:
    """Repeat each event at `times_each` times of its own segment; also the index (m,) of each event repeated.

    The times are those of the segment's events at ranks spread evenly, shifted from event to event by the golden
    ratio: an even mixture of place and time without random numbers. A segment of one event gets none.
    """
    segments = events.starts.size - 1
    starts = np.zeros(segments + 1, np.int64)
    for k in range(segments):
        count = events.starts[k + 1] - events.starts[k]
        starts[k + 1] = starts[k] + (count * times_each if count > 1 else 0)
    t_s, rows = np.empty(starts[-1]), np.empty(starts[-1], np.int64)
    for k in range(segments):
        first, at = events.starts[k], starts[k]
        count = (starts[k + 1] - at) // times_each
        for i in range(count):
            shift = (i * GOLDEN_RATIO) % 1.0
            for j in range(times_each):
                t_s[at] = events.t_s[first + int((j + shift) / times_each * count)]
                rows[at] = first + i
                at += 1
    return EventColumns(t_s, take_columns(events.normals, rows), _taken(events.polarity, rows), starts), rows


@numba.njit(cache=True, nogil=True)
def _taken(column: Integers, rows: Integers) -> Integers:
    """Entries (m,) of a column (n,)."""
    taken = np.empty(rows.size, column.dtype)
    for i in range(rows.size):
        taken[i] = column[rows[i]]
    return taken


@numba.njit(cache=True, nogil=True)
def take_columns(table: Floats, rows: Integers) -> Floats:
    """Columns (3, m) of a table (3, n)."""
    taken = np.empty((3, rows.size))
    for axis in range(3):
        for i in range(rows.size):
            taken[axis, i] = table[axis, rows[i]]
    return taken


@numba.njit(cache=True, nogil=True)
def whole_window(events: EventColumns, times_each: int, apart_s: float) -> ScoreWindow:
    """The events in the segments they have, each permuted `times_each` times; `apart_s` as in `ScoreWindow`."""
    permuted, rows = time_permuted(events, times_each)
    return ScoreWindow(events, permuted, rows, apart_s)


@numba.njit(cache=True, nogil=True)
def segment_starts(t_s: Floats, segment_s: float) -> Integers:
    """Indices (k + 1,) int64 at which the segments of this length that hold events start, and the number of events."""
    starts = np.empty(t_s.size + 1, np.int64)
    count, number = 0, -1
    for i in range(t_s.size):
        at = int((t_s[i] - t_s[0]) / segment_s)
        if at != number:
            starts[count] = i
            count, number = count + 1, at
    starts[count] = t_s.size
    return starts[: count + 1]


@numba.njit(cache=True, nogil=True)
def segmented_window(events: EventColumns, segment_s: float, max_events: int, segment_events: int) -> ScoreWindow:
    """The events in new segments no longer than segment_s, thinned evenly.

    Events within a segment are thinned to about `segment_events` on average, then whole segments are left out,
    evenly, until about `max_events` are left: thinning alone would leave no pairs.
    """
    t_s = events.t_s
    bounds = segment_starts(t_s, segment_s)
    segments = bounds.size - 1
    stride = max(1, int(t_s.size / max(segments, 1) / segment_events + 0.5))
    left = (t_s.size + stride - 1) // stride
    every = max(1, -(-left // max_events))
    rows, starts = np.empty(left, np.int64), np.empty(segments + 1, np.int64)
    kept, count = 0, 0
    for k in range(0, segments, every):
        starts[count] = kept
        for i in range(-(-bounds[k] // stride) * stride, bounds[k + 1], stride):
            rows[kept] = i
            kept += 1
        if kept > starts[count]:
            count += 1
    starts[count] = kept
    rows = rows[:kept]
    thinned_s = np.empty(kept)
    for i in range(kept):
        thinned_s[i] = t_s[rows[i]]
    normals, polarity = take_columns(events.normals, rows), _taken(events.polarity, rows)
    return whole_window(EventColumns(thinned_s, normals, polarity, starts[: count + 1]), 1, 0.0)


@numba.njit(cache=True, nogil=True)
def offset_slopes(normals: Floats, facing: Floats, radius_px: Floats) -> Floats:
    """Derivatives (3, 3, n) per px of the normals (3, n) by the ball's centre x, centre y and radius.

    Ball far from the camera: the disc's coordinates shift and shrink, the normal stays on the sphere. `facing` and
    `radius_px` as in `SphereEvents`.
    """
    slopes = np.empty((3, 3, normals.shape[1]))
    for i in range(normals.shape[1]):
        ux, uy, uz = facing[0, i], facing[1, i], facing[2, i]
        # The image's axes as seen from the ball: across = x less its part along u, down = u cross across.
        length = math.sqrt(max(1.0 - ux * ux, 1e-12))
        ax, ay, az = (1.0 - ux * ux) / length, -ux * uy / length, -ux * uz / length
        dx, dy, dz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
        across = ax * normals[0, i] + ay * normals[1, i] + az * normals[2, i]
        down = dx * normals[0, i] + dy * normals[1, i] + dz * normals[2, i]
        depth = math.sqrt(max(1.0 - across * across - down * down, 0.04))  # at the very rim it would have no end
        for k, (by_across, by_down) in enumerate(((-1.0, 0.0), (0.0, -1.0), (-across, -down))):
            by_depth = -(across * by_across + down * by_down) / depth
            slopes[k, 0, i] = (by_across * ax + by_down * dx - by_depth * ux) / radius_px[i]
            slopes[k, 1, i] = (by_across * ay + by_down * dy - by_depth * uy) / radius_px[i]
            slopes[k, 2, i] = (by_across * az + by_down * dz - by_depth * uz) / radius_px[i]
    return slopes


@numba.njit(cache=True, nogil=True)
def shifted_normals(normals: Floats, slopes: Floats, offsets_px: Floats) -> Floats:
    """Unit normals (3, n) on a ball whose centre and radius are off by offsets_px (3,), see `offset_slopes`."""
    shifted = np.empty_like(normals)
    x_px, y_px, wider_px = offsets_px[0], offsets_px[1], offsets_px[2]
    for row in range(3):
        right, lower, wider = slopes[0, row], slopes[1, row], slopes[2, row]
        for i in range(normals.shape[1]):
            shifted[row, i] = normals[row, i] + x_px * right[i] + y_px * lower[i] + wider_px * wider[i]
    for i in range(normals.shape[1]):
        shrink = 1.0 / math.sqrt(shifted[0, i] ** 2 + shifted[1, i] ** 2 + shifted[2, i] ** 2)
        for row in range(3):
            shifted[row, i] *= shrink
    return shifted
