"""Suite `detector`: the ball's place, size and velocity against speed (section 4.2 and its figure)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...calibration.ball_labels import STEP_US, BallLabels, labels_beside
from ...camera import BallParameters
from ...chain import Chain
from ...errors import RecordingError
from ...registry import Parameters
from ...results import Circle, Truth
from ...simulator import flight
from ...stages.track_kalman import OBSERVED, BallFilter
from ...tick import Tick
from .. import paper
from ..estimation import chain_over
from ..lab_recordings import FLIGHT, LabRecording
from ..plots import Figures, curve, label_axes, panels
from ..rendering import camera_of, render
from ..tables import Cell, ResultTable, Row, Summary, distinct, share, summary, where
from ..tasks import Task, TaskContext
from ..tracking_rivals import BallState, ConvolutionPeak, MeanShift, ball_state

LABEL = "Ball detector: error against speed"
HELP = "Errors of the ball's place, size and velocity against its speed (section 4.2)."

TAKES_SCENE_CHOICES = True
REAL_KINDS = (FLIGHT,)

QUICK_SEED, SEED = 882_541, 625_874  # of this suite alone: of `--quick`, and drawn for the published results
SPEEDS_M_S = tuple(float(speed) for speed in range(4, 21, 2))
SCENES = ("one ball", "two balls", "arm")
REAL = "real recordings"
FLIGHTS = 3  # of each speed and scene
PEAK, MEAN_SHIFT = "rival: convolution peak", "rival: mean shift"
STAGES = ("hough", "hough + kalman", "refined", "refined + kalman", PEAK, MEAN_SHIFT)
FINAL = "refined + kalman"  # what the other stages of the chain get

# The paper's filter, fed with the Hough circle: its error is about a pixel, its start knows nothing of the velocity.
HOUGH_STD_PX, FASTEST_M_S, ACCELERATION_M_S2, APPROACH_M_S, MOST_SURPRISE = 1.0, 25.0, 15.0, 3.0, 25.0
MOST_MISSES = 2  # circles in a row that do not fit: the filter follows something else and starts anew
ASIDE_US = 500  # the truth's velocity is the difference of places so far before and after


def tasks(quick: bool) -> list[Task]:
    """One flight a task."""
    first_seed = QUICK_SEED if quick else SEED
    if quick:
        chosen = [("one ball", 8.0), ("two balls", 16.0)]
    else:
        chosen = [(scene, speed) for scene in SCENES for speed in SPEEDS_M_S for _ in range(FLIGHTS)]
    return [
        Task(measure, {"scene": scene, "speed_m_s": speed, "seed": first_seed + number})
        for number, (scene, speed) in enumerate(chosen)
    ]


def measure(context: TaskContext, scene: str, speed_m_s: float, seed: int) -> list[Row]:
    """Every stage's errors in every tick in which all of the ball is in view."""
    two, arm = scene == "two balls", scene == "arm"
    shown = flight(
        kind="top",
        magnitude_rps=40.0,
        speed_m_s=speed_m_s,
        second_ball=two,
        arm=arm,
        ball=context.scene.ball,
        camera=camera_of(context),
        seed=seed,
    )
    recording = render(context, shown, seed=seed)
    about: Row = {"scene": scene, "speed_m_s": speed_m_s, "seed": seed}
    return _rows(chain_over(recording), context.parameters, recording.truth, about)


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """The same against the labels `NAME.labels.csv` of a real flight, as `spinscope label` makes them."""
    path, session = labels_beside(recording.path), recording.session
    if not path.is_file():
        raise RecordingError(f"no labels of the ball: make them with `spinscope label`: {path.name}")
    labels = BallLabels.read(path)
    rows: list[Row] = []
    for number in np.unique(labels.ball):
        flight = labels.of_ball(int(number))
        centres_m = session.camera.ball_centre_m(flight.x_px, flight.y_px, flight.radius_px, session.ball_radius_m)
        seconds = (flight.t_us - flight.t_us[0]) * 1e-6
        speed_m_s = round(float(np.linalg.norm(np.polyfit(seconds, centres_m[:, :2], 1)[0])))
        about: Row = {"scene": REAL, "speed_m_s": float(speed_m_s), "seed": None}
        rows += _rows(session.chain, session.parameters, flight, about)
    return rows


def _rows(chain: Chain, parameters: Parameters, ball: Truth | BallLabels, about: Row) -> list[Row]:
    """Every stage's errors in every tick in which the true ball is known and all of it in view."""
    camera = chain.camera(parameters)
    followers: dict[str, HoughKalman | ConvolutionPeak | MeanShift] = {
        "hough + kalman": HoughKalman(parameters.ball, camera.focal_px),
        PEAK: ConvolutionPeak(),
        MEAN_SHIFT: MeanShift(),
    }
    rows: list[Row] = []
    for tick in chain.run(parameters, ("track",), forget=("surface",)):
        truth = _truth_at(ball, (camera.width_px, camera.height_px), tick.track.t_us)
        found = _found(tick, truth) | {stage: follower.step(tick) for stage, follower in followers.items()}
        if truth is not None:
            rows += [_row({**about, "t_us": tick.track.t_us}, stage, found[stage], truth) for stage in STAGES]
    return rows


class HoughKalman:
    """The paper's filter, which takes the Hough circle as it is.

    It starts with the first circle of a track, and again where it has lost the ball.
    """

    def __init__(self, ball: BallParameters, focal_px: float) -> None:
        self.radius_m = ball.diameter_mm / 2000.0
        self.focal_px = focal_px
        self.filter: BallFilter | None = None
        self.last_us = 0
        self.misses = 0

    def step(self, tick: Tick) -> BallState | None:
        """The filter's state at the end of a tick; None while there is no track."""
        end_us, circle = tick.packet.end_us, tick.track.hough
        if not tick.track.has_ball:
            self.filter = None
        elif self.filter is None or self.misses >= MOST_MISSES:
            self.filter = None if circle is None else self._begun(circle)
            self.misses = 0
        else:
            self.filter.predict((end_us - self.last_us) * 1e-6)
            if circle is not None:
                seen = np.array([circle.x_px, circle.y_px, circle.radius_px])
                fits = self.filter.update(seen, np.eye(len(OBSERVED)) * HOUGH_STD_PX**2, MOST_SURPRISE)
                self.misses = 0 if fits else self.misses + 1
        self.last_us = end_us
        return None if self.filter is None else self.filter.mean

    def _begun(self, circle: Circle) -> BallFilter:
        per_m = circle.radius_px / self.radius_m
        std = np.array([HOUGH_STD_PX, HOUGH_STD_PX, FASTEST_M_S * per_m, FASTEST_M_S * per_m, HOUGH_STD_PX])
        mean = np.array([circle.x_px, circle.y_px, 0.0, 0.0, circle.radius_px])
        approach_px_s = APPROACH_M_S * per_m * circle.radius_px / self.focal_px
        return BallFilter(mean, np.diag(std**2), ACCELERATION_M_S2 * per_m, approach_px_s)


def _found(tick: Tick, truth: BallState | None) -> dict[str, BallState | None]:
    """State of the ball after every stage of the tracker at the end of a tick, None where a stage has none.

    Hough circles are those of the ball that is followed, refined ones of the ball nearest the true one.
    """
    track = tick.track
    place = track.mean if truth is None else truth
    nearest = min(track.balls, key=lambda ball: float(np.hypot(*(ball.mean[:2] - place[:2]))), default=None)
    return {
        "hough": ball_state(track.hough),
        "refined": None if nearest is None else ball_state(nearest.measured),
        "refined + kalman": None if nearest is None else nearest.mean,
    }


def _truth_at(truth: Truth | BallLabels, size_px: tuple[int, int], t_us: float) -> BallState | None:
    """The true ball at a time; None unless all of it is in the image, and for a while on both sides.

    Labels that were deleted leave a gap: beyond a single one it is not bridged.
    """
    around = np.array([t_us - ASIDE_US, t_us, t_us + ASIDE_US])
    if around[0] < truth.t_us[0] or around[2] > truth.t_us[-1]:
        return None
    first, last = np.searchsorted(truth.t_us, around[0], "right") - 1, np.searchsorted(truth.t_us, around[2])
    if np.diff(truth.t_us[first : last + 1]).max(initial=0) > 2 * STEP_US:
        return None
    x, y, radius = (np.interp(around, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px))
    most = radius.max()
    if min(x.min(), y.min()) < most or x.max() > size_px[0] - most or y.max() > size_px[1] - most:
        return None
    slope = 1e6 / (2 * ASIDE_US)
    return np.array([x[1], y[1], (x[2] - x[0]) * slope, (y[2] - y[0]) * slope, radius[1]])


def _row(about: Row, stage: str, found: BallState | None, truth: BallState) -> Row:
    """Errors of one stage in one tick; a circle whose centre lies outside the true ball is another's: not found."""
    row: Row = {**about, "stage": stage, "found": False}
    row |= dict.fromkeys(("centre_error_px", "along_px", "across_px", "radius_error_px", "velocity_error_px_s"))
    if found is None or np.hypot(*(found[:2] - truth[:2])) > truth[4]:
        return row
    offset, motion = found[:2] - truth[:2], truth[2:4] / np.hypot(*truth[2:4])
    return row | {
        "found": True,
        "centre_error_px": float(np.hypot(*offset)),
        "along_px": float(offset @ motion),
        "across_px": float(offset[0] * -motion[1] + offset[1] * motion[0]),
        "radius_error_px": float(abs(found[4] - truth[4])),
        "velocity_error_px_s": None if np.isnan(found[2]) else float(np.hypot(*(found[2:4] - truth[2:4]))),
    }


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """The stages in each scene, and against the speed."""
    scenes, speeds = distinct(rows, "scene"), distinct(rows, "speed_m_s")
    columns = ("stage", "ticks", "found", "centre [px]", "along the motion [px]", "radius [px]", "velocity [px/s]")
    by_scene: list[tuple[Cell, ...]] = [
        (f"paper ({scenes[0]})", "hough + kalman", None, None, paper.DETECTOR, None, None, None)
    ]
    by_scene += [(scene, *_line(where(rows, scene=scene, stage=stage), stage)) for scene in scenes for stage in STAGES]
    by_speed = [
        (scene, speed, *_line(part, stage))
        for scene in scenes
        for speed in sorted(speeds)
        for stage in (STAGES if scene in (SCENES[0], REAL) else (FINAL,))
        if (part := where(rows, scene=scene, speed_m_s=speed, stage=stage))
    ]
    return [
        ResultTable("Ball detector by scene", ("scene", *columns), by_scene, NOTE),
        ResultTable("Ball detector by speed", ("scene", "speed [m/s]", *columns), by_speed, NOTE_OF_TWO),
    ]


NOTE = (
    "Absolute errors over all ticks with the whole ball in view, at the end of the tick, as a robot would have them; "
    "along the motion signed (negative = behind). Found: a circle whose centre lies on the ball. The rivals (PUCK's "
    "convolution peak, mean shift of events) begin with the first circle of each track and are run once a tick."
)
NOTE_OF_TWO = (
    "Two balls: the second one crosses at 2 to 6 m/s. The Hough circles are those of the ball that is followed, which "
    "may be the second one."
)


def _line(part: Sequence[Row], stage: str) -> tuple[Cell, ...]:
    errors = (summary(part, name) for name in ("centre_error_px", "along_px", "radius_error_px"))
    velocity = summary(part, "velocity_error_px_s") if "kalman" in stage else Summary.over([])
    return stage, len(part), share(part, lambda row: bool(row["found"])), *errors, velocity


def figures(rows: Sequence[Row]) -> Figures:
    """Errors against the speed (the paper's figure of the detector)."""
    scenes = distinct(rows, "scene")
    labels = {
        "centre_error_px": "centre error [px]",
        "radius_error_px": "radius error [px]",
        "velocity_error_px_s": "velocity error [px/s]",
    }
    figure, axes = panels(len(scenes), len(labels))
    for line, scene in zip(axes, scenes, strict=True):
        for panel, (name, label) in zip(line, labels.items(), strict=True):
            for color, stage in enumerate(STAGES):
                curve(panel, where(rows, scene=scene, stage=stage), "speed_m_s", name, stage, color=color)
            label_axes(panel, scene, "speed [m/s]", label, log=True)
    return {"errors": figure}
