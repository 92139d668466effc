"""Suite `biases`: event rates of noise and of a ball against each bias, and pictures of the logo (supplement)."""

from __future__ import annotations

import base64
import dataclasses
import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ...biases import PAPER, BiasParameters
from ...camera import Camera
from ...errors import RecordingError, SpinscopeError
from ...events import EventBatch
from ...session import Session
from ...shots import Shot
from ...sidecar import biases_beside
from ...simulator import Background, Scene, SimulatedRecording, flight, simulate_scene
from ...simulator.sensor import LOGO
from ..estimation import PAPER_METHOD, longest
from ..lab_recordings import FLIGHT, SPINNER, LabFolder, LabRecording
from ..plots import Figures, curve, label_axes, panels
from ..rendering import camera_of
from ..tables import Cell, ResultTable, Row, distinct, summary, where
from ..tasks import Task, TaskContext

LABEL = "Biases: event rates and pictures of the logo"
HELP = "Event rates of noise and ball against each bias, and pictures of the logo (supplement)."

TAKES_SCENE_CHOICES = True
REAL_KINDS = (FLIGHT, SPINNER)

SEED = 538_959
FLIGHTS = 5  # the paper averages over 5 samples
STATIC_S = 1.0
SPEED_M_S, SPIN_RPS = 7.5, 40.0  # 6,000 px/s, the supplement's nominal velocity

# Bias -> the biases it sets, the values looked at, and those of the quick suite.
SWEEPS: dict[str, tuple[tuple[str, ...], tuple[int, ...], tuple[int, ...]]] = {
    "diff_on = diff_off": (("diff_on", "diff_off"), (-35, -20, 0, 20, 40, 60, 90, 140), (0, 40, 140)),
    "fo": (("fo",), (-35, -20, -10, 0, 25, 55), (-35, 55)),
    "hpf": (("hpf",), (0, 10, 20, 40, 60, 120), (0, 120)),
    "refr": (("refr",), (-20, 0, 40, 80, 120, 180, 235), (-20, 80, 235)),
}
# The supplement's pictures: bias -> (values, microseconds shown); `fo` as linear time surfaces.
PICTURES = {"diff_on = diff_off": ((40, 90, 140), 3000), "refr": ((120, 80, -20), 2000), "fo": ((-35, 55), 1000)}
NEEDS = ("simulator", "biases.py", "evaluation/suites/biases.py")  # the estimators have no part in it
PICTURE_PX = 64  # side of a picture; the ball has a radius of about 17 px
# Of real recordings: half a picture's side over the ball's radius, and the share of it that the rim does not reach.
PICTURE_RADII, INNER_SHARE = 1.9, 0.8


def tasks(quick: bool) -> list[Task]:
    """One setting and scene a task."""
    duration = {"duration_ms": 25 if quick else None}  # the ball's way in is enough to see the bias work
    every: list[Task] = []
    for sweep, (_, values, few) in SWEEPS.items():
        for value in few if quick else values:
            setting = {"sweep": sweep, "value": value}
            every.append(Task(measure_noise, {**setting, "seed": SEED}, needs=NEEDS))
            for seed in range(SEED, SEED + (1 if quick else FLIGHTS)):
                every.append(Task(measure_ball, {**setting, "seed": seed, **duration}, needs=NEEDS))
    pictures = [{"sweep": sweep, "value": value} for sweep, (shown, _) in PICTURES.items() for value in shown]
    every += [Task(take_picture, picture | duration, needs=NEEDS) for picture in pictures[-2 if quick else 0 :]]
    return every


def _set(sweep: str, value: int) -> BiasParameters:
    return PAPER.with_values(dict.fromkeys(SWEEPS[sweep][0], value))


def _row(what: str, sweep: str, value: int, seed: int | None, made: SimulatedRecording | None = None) -> Row:
    """The columns of every row; the rates are those of the recording, None without one."""
    paper = all(getattr(PAPER, name) == value for name in SWEEPS[sweep][0])
    row: Row = {"what": what, "sweep": sweep, "value": value, "paper": paper, "seed": seed}
    row |= dict.fromkeys(("on_hz", "off_hz", "logo_hz", "off_px"))
    if made is not None:
        on, seconds = made.events.on, made.scene.duration_s
        row |= {"on_hz": float(on.sum()) / seconds, "off_hz": float((~on).sum()) / seconds}
    return row


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """Event rates of a real recording, of noise where no ball is found in it, in every sweep that it belongs to.

    It belongs to the sweep of a bias where all others are the paper's.
    """
    biases, session = recording.biases, recording.session
    sweeps = [
        (sweep, getattr(biases, names[0]))
        for sweep, (names, _, _) in SWEEPS.items()
        if len({getattr(biases, name) for name in names}) == 1
        and all(getattr(biases, name) == getattr(PAPER, name) for name in biases.tunables() if name not in names)
    ]
    if not sweeps:
        changed = ", ".join(f"{name} {value}" for name, value in biases.as_dict().items())
        raise RecordingError(
            f"its biases ({changed}) differ from the paper's in more than one of {', '.join(SWEEPS)}: change one at a "
            "time"
        )
    start_us, end_us = session.source.start_us, session.source.end_us
    on, seconds = session.source.between(start_us, end_us).on, (end_us - start_us) * 1e-6
    shot = longest(session.estimate(PAPER_METHOD))
    what = "noise" if shot is None else "ball"
    rates: Row = {"on_hz": float(on.sum()) / seconds, "off_hz": float((~on).sum()) / seconds}
    rows = [_row(what, sweep, value, None) | rates for sweep, value in sweeps]
    pictured = [(sweep, value) for sweep, value in sweeps if sweep in PICTURES]
    if shot is not None and pictured and recording.kind == FLIGHT and (reference := _reference(recording)):
        for sweep, value in pictured:
            rows += _same_pose(session, shot, sweep, value, reference)
    return rows


def _reference(recording: LabRecording) -> tuple[LabRecording, Shot] | None:
    """The recording in the same folder with the paper's biases and a ball, by which the others are aligned."""
    for other in LabFolder.of(recording.path.parent, recording.choices).recordings:
        if other.path.parent != recording.path.parent:
            continue
        with suppress(SpinscopeError):  # what is wrong with it is said where it is measured itself
            if biases_beside(other.path) == PAPER and (shot := longest(other.session.estimate(PAPER_METHOD))):
                return other, shot
    return None


def _same_pose(session: Session, shot: Shot, sweep: str, value: int, reference: tuple[LabRecording, Shot]) -> list[Row]:
    """The picture of a ball where that of the reference shows most; none where it never comes there.

    For a robot arm that repeats its movement equal places are equal poses.
    """
    span_us = PICTURES[sweep][1]
    other, its_shot = reference
    inside = _events_on_ball(other.session, its_shot, span_us)
    if not inside.size:
        return []
    place = its_shot.state[np.argmax(inside)]
    away = np.hypot(shot.state[:, 0] - place[0], shot.state[:, 1] - place[1])
    nearest = int(np.argmin(away))
    # Between two ticks the ball goes on evenly: back or on to the foot of the perpendicular.
    x, y, vx, vy = shot.state[nearest, :4]
    late_s = ((place[0] - x) * vx + (place[1] - y) * vy) / max(vx**2 + vy**2, 1.0)
    x, y = x + vx * late_s, y + vy * late_s
    off_px = float(np.hypot(x - place[0], y - place[1]))
    if off_px > place[4]:
        return []
    at_us = round(float(shot.t_us[nearest]) + 1e6 * late_s + session.parameters.track.latency_us)
    side = 2 * math.ceil(PICTURE_RADII * float(place[4]))
    shown = session.source.between(at_us - span_us, at_us)
    row = _row("picture", sweep, value, None) | {"span_us": span_us, "off_px": off_px}
    return [row | {"picture": _drawn(shown, at_us, (x, y), side, sweep)}]


def _events_on_ball(session: Session, shot: Shot, span_us: int) -> NDArray[np.int64]:
    """(n,) events of a span on the ball, without its rim, before each tick of the shot."""
    counts = np.zeros(shot.t_us.size, np.int64)
    for tick, (t_us, state) in enumerate(zip(shot.t_us, shot.state, strict=True)):
        end_us = round(float(t_us) + session.parameters.track.latency_us)
        seen = session.source.between(end_us - span_us, end_us)
        x, y, vx, vy, radius = state
        ago_s = (end_us - seen.t_us) * 1e-6
        away = np.hypot(seen.x_px - x + vx * ago_s, seen.y_px - y + vy * ago_s)
        counts[tick] = np.count_nonzero(away < INNER_SHARE * radius)
    return counts


def measure_noise(context: TaskContext, sweep: str, value: int, seed: int) -> list[Row]:
    """Events a second of a scene in which nothing moves."""
    scene = Scene(STATIC_S, (), background=Background())
    made = simulate_scene(scene, sensor=_set(sweep, value), seed=seed)
    return [_row("noise", sweep, value, seed, made)]


def _flying(context: TaskContext, seed: int, duration_ms: int | None) -> Scene:
    scene = flight(
        kind="top",
        magnitude_rps=SPIN_RPS,
        speed_m_s=SPEED_M_S,
        ball=context.scene.ball,
        camera=camera_of(context),
        seed=seed,
    )
    duration_s = scene.duration_s if duration_ms is None else min(scene.duration_s, duration_ms / 1000)
    return dataclasses.replace(scene, duration_s=duration_s)


def measure_ball(context: TaskContext, sweep: str, value: int, seed: int, duration_ms: int | None) -> list[Row]:
    """Events a second of everything while a ball flies through, as the supplement counts them, and of its logo."""
    scene = _flying(context, seed, duration_ms)
    made = simulate_scene(scene, camera=camera_of(context), sensor=_set(sweep, value), seed=seed)
    logo_hz = float(made.logo_events) / scene.duration_s
    return [_row("ball", sweep, value, seed, made) | {"logo_hz": logo_hz}]


def take_picture(context: TaskContext, sweep: str, value: int, duration_ms: int | None) -> list[Row]:
    """The ball at the moment when its logo makes most events (at the paper's biases)."""
    scene, camera = _flying(context, SEED, duration_ms), camera_of(context)
    span_us = PICTURES[sweep][1]
    at_us = _busiest(scene, camera, span_us)
    made = simulate_scene(scene, camera=camera, sensor=_set(sweep, value), seed=SEED)
    shown = made.events.between(at_us - span_us, at_us)
    truth = made.truth
    centre = float(np.interp(at_us, truth.t_us, truth.x_px)), float(np.interp(at_us, truth.t_us, truth.y_px))
    row = _row("picture", sweep, value, SEED) | {"span_us": span_us, "off_px": 0.0}
    return [row | {"picture": _drawn(shown, at_us, centre, PICTURE_PX, sweep)}]


def _drawn(shown: EventBatch, at_us: int, centre_px: tuple[float, float], side: int, sweep: str) -> str:
    """A picture of so many pixels a side, as text for a row: the last event of each pixel before a time."""
    x, y = (
        column.astype(np.int64) - round(middle - side / 2)
        for column, middle in zip((shown.x_px, shown.y_px), centre_px, strict=True)
    )
    inside = (x >= 0) & (y >= 0) & (x < side) & (y < side)
    sign = np.where(shown.on, 1.0, -1.0)
    if sweep == "fo":  # linear time surface: the latest event counts, the older the less
        sign = sign * (1 - (at_us - shown.t_us) / PICTURES[sweep][1])
    picture = np.zeros((side, side))
    picture[y[inside], x[inside]] = sign[inside]
    return base64.b64encode(np.rint(127 * picture).astype(np.int8).tobytes()).decode("ascii")


def picture_of(row: Row) -> NDArray[np.float64]:
    """(side, side) float64 in -1 (OFF) to 1 (ON) of a row with a picture."""
    flat = np.frombuffer(base64.b64decode(str(row["picture"])), np.int8)
    side = math.isqrt(flat.size)
    return flat.reshape(side, side) / 127.0


def _busiest(scene: Scene, camera: Camera, span_us: int) -> int:
    """End of the span with most logo events, the whole ball being in view."""
    made = simulate_scene(scene, camera=camera, sensor=PAPER, seed=SEED)
    x, y, half = made.truth.x_px, made.truth.y_px, PICTURE_PX / 2
    seen = (x > half) & (x < made.width_px - half) & (y > half) & (y < made.height_px - half)
    ends = made.truth.t_us[seen & (made.truth.t_us >= span_us)]
    logo_us = made.events.t_us[made.truth.label == LOGO]
    counts = np.searchsorted(logo_us, ends) - np.searchsorted(logo_us, ends - span_us)
    return int(ends[np.argmax(counts)])


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Rates against each bias."""
    result = []
    for sweep in distinct(rows, "sweep"):
        lines: list[tuple[Cell, ...]] = []
        for value in sorted(distinct([row for row in rows if row["what"] != "picture"], "value")):
            noise = where(rows, sweep=sweep, value=value, what="noise")
            ball = where(rows, sweep=sweep, value=value, what="ball")
            if not noise and not ball:
                continue
            mark = f"{value} (paper)" if (noise + ball)[0]["paper"] else str(value)
            rates = [summary(noise, name).mean for name in ("on_hz", "off_hz")]
            lines.append((mark, *rates, *(summary(ball, name) for name in ("on_hz", "off_hz", "logo_hz"))))
        columns = ("bias", "noise ON [1/s]", "noise OFF [1/s]", "ball ON [1/s]", "ball OFF [1/s]", "logo [1/s]")
        result.append(ResultTable(f"Event rate against bias_{sweep}", columns, lines, EXPECTED[sweep]))
    aligned = [row for row in rows if row["what"] == "picture" and row["seed"] is None]
    if aligned:
        names = ("recording", "sweep", "value", "off_px")
        of_pictures: list[tuple[Cell, ...]] = [tuple(row[name] for name in names) for row in aligned]
        header = ("recording", "bias", "value", "off the reference's place [px]")
        result.append(ResultTable("Pictures at equal places of the ball", header, of_pictures, ALIGNED_NOTE))
    return result


ALIGNED_NOTE = (
    "Of recordings of one movement, as of a robot arm: where the ball of the one with the paper's biases shows most "
    "events inside its rim. A recording whose ball never comes there has no picture."
)


EXPECTED = {
    "diff_on = diff_off": "The supplement: noise falls to an acceptable level at 40; above 60 ON and OFF part.",
    "fo": "The supplement: only values below 0 change the rate.",
    "hpf": "The supplement: above 0 slow motion is lost; 0 keeps most events.",
    "refr": "The supplement: the rate rises with the bias; above 80 mostly noise, ON more than OFF.",
}


def figures(rows: Sequence[Row]) -> Figures:
    """Event rates against each bias, and the logo's pictures (the supplement's figures)."""
    sweeps = distinct(rows, "sweep")
    figure, axes = panels(2, len(sweeps))
    for line, what in zip(axes, ("noise", "ball"), strict=True):
        for panel, sweep in zip(line, sweeps, strict=True):
            part = where(rows, sweep=sweep, what=what)
            for color, (name, label) in enumerate((("on_hz", "ON"), ("off_hz", "OFF"))):
                curve(panel, part, "value", name, label, color=color)
            for paper in sorted(distinct(where(part, paper=True), "value")):
                panel.axvline(paper, color="green", linewidth=1)
            title = f"{what}, bias_{sweep}"
            label_axes(panel, title, "bias (green: the paper's)", "events [1/s]", log=what == "noise")
    result = {"rates": figure}
    pictures = sorted(where(rows, what="picture"), key=lambda row: (sweeps.index(row["sweep"]), row["value"]))
    if pictures:
        columns = min(len(pictures), 4)
        figure, axes = panels(-(-len(pictures) // columns), columns)
        for panel in axes.flat:
            panel.set_axis_off()
        for panel, row in zip(axes.flat, pictures, strict=False):
            panel.imshow(picture_of(row), cmap="coolwarm", vmin=-1, vmax=1)
            panel.set_title(f"bias_{row['sweep']}: {row['value']} ({row['span_us']} us)", fontsize=10)
        result["pictures"] = figure
    return result
