"""Suite `biases`: event rates of noise and of a ball against each bias, and pictures of the logo (supplement)."""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...biases import PAPER, BiasParameters
from ...camera import Camera
from ...errors import RecordingError
from ...simulator import Background, Scene, SimulatedRecording, flight, simulate_scene
from ...simulator.sensor import LOGO
from ..lab_recordings import FLIGHT, SPINNER, LabRecording
from ..plots import Figures, curve, label_axes, panels
from ..rendering import camera_of
from ..tables import Cell, ResultTable, Row, distinct, summary, where
from ..tasks import Task, TaskContext

LABEL = "Biases: event rates and pictures of the logo"
HELP = "Event rates of noise and ball against each bias, and pictures of the logo (supplement)."

TAKES_SCENE_CHOICES = True
REAL_KINDS = (FLIGHT, SPINNER)

SEED = 322_591
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
    row |= dict.fromkeys(("on_hz", "off_hz", "logo_hz"))
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
    what = "ball" if session.estimate("triplet").shots else "noise"
    rates: Row = {"on_hz": float(on.sum()) / seconds, "off_hz": float((~on).sum()) / seconds}
    return [_row(what, sweep, value, None) | rates for sweep, value in sweeps]


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
    x, y = (
        column.astype(np.int64) - round(float(np.interp(at_us, truth.t_us, centre)) - PICTURE_PX / 2)
        for column, centre in ((shown.x_px, truth.x_px), (shown.y_px, truth.y_px))
    )
    inside = (x >= 0) & (y >= 0) & (x < PICTURE_PX) & (y < PICTURE_PX)
    sign = np.where(shown.on, 1.0, -1.0)
    if sweep == "fo":  # linear time surface: the latest event counts, the older the less
        sign = sign * (1 - (at_us - shown.t_us) / span_us)
    picture = np.zeros((PICTURE_PX, PICTURE_PX))
    picture[y[inside], x[inside]] = sign[inside]
    row = _row("picture", sweep, value, SEED) | {"span_us": span_us}
    row["picture"] = base64.b64encode(np.rint(127 * picture).astype(np.int8).tobytes()).decode("ascii")
    return [row]


def picture_of(row: Row) -> NDArray[np.float64]:
    """(PICTURE_PX, PICTURE_PX) float64 in -1 (OFF) to 1 (ON) of a row of `take_picture`."""
    flat = np.frombuffer(base64.b64decode(str(row["picture"])), np.int8)
    return flat.reshape(PICTURE_PX, PICTURE_PX) / 127.0


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
    return result


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
    pictures = where(rows, what="picture")
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
