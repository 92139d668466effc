"""Labels of the ball by blobs: near the simulator's truth, with an honest error, and none where no ball flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.calibration.ball_labels import EXPOSURE_US, LAG_PX, BallLabels, _Blob, _labels, ball_labels
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.evaluation import TaskContext
from spinscope.pipeline.evaluation.real_recordings import evaluate_real
from spinscope.pipeline.evaluation.suites import SUITES
from spinscope.pipeline.evaluation.tables import where
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.results import Truth
from spinscope.pipeline.simulator import SimulatedRecording, flight, simulate_scene

SIZE = 720, 1280


def simulated(speed_m_s: float, seed: int) -> SimulatedRecording:
    return simulate_scene(flight(kind="mixed", magnitude_rps=40, speed_m_s=speed_m_s, seed=seed), seed=seed)


def errors_px(labels: BallLabels, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Distances of the centres, and errors of the radii."""
    x, y, radius = (np.interp(labels.t_us, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px))
    return np.hypot(labels.x_px - x, labels.y_px - y), labels.radius_px - radius


@pytest.fixture(scope="module")
def made() -> SimulatedRecording:
    return simulated(10.0, 78_011)


def test_labels_lie_on_the_ball(made: SimulatedRecording, tmp_path: Path) -> None:
    labels = ball_labels(made.events, SIZE)
    off_px, radius_px = errors_px(labels, made.truth)
    assert labels.t_us.size > 15 and set(labels.ball) == {1}
    assert off_px.mean() < 0.3 and off_px.max() < 0.6 and np.abs(radius_px).mean() < 0.25
    assert 0.05 < labels.std_px[0] < 0.2
    labels.write(tmp_path / "a.csv")
    again = BallLabels.read(tmp_path / "a.csv")
    assert again.x_px == pytest.approx(labels.x_px, abs=1e-3) and np.array_equal(again.ball, labels.ball)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [78_021, 78_022])
@pytest.mark.parametrize("speed_m_s", [4.0, 6.0, 8.0, 12.0])
def test_labels_at_the_papers_speeds(speed_m_s: float, seed: int) -> None:
    recording = simulated(speed_m_s, seed)
    off_px, radius_px = errors_px(ball_labels(recording.events, SIZE), recording.truth)
    assert off_px.mean() < 0.3 and np.abs(radius_px).mean() < 0.25


def test_detector_is_judged_by_labels(made: SimulatedRecording, tmp_path: Path) -> None:
    write_recording(tmp_path / "a.raw", made.events, width_px=1280, height_px=720)
    assert "detector" in SUITES.names
    (missing,) = evaluate_real("detector", tmp_path, TaskContext()).tables
    assert "make them with `spinscope label`" in str(missing.rows[-1][2])
    done = CliRunner().invoke(cli, ["label", str(tmp_path / "a.raw")])
    assert done.exit_code == 0 and "labels of 1 flights" in done.output
    found = evaluate_real("detector", tmp_path, TaskContext())
    ours = where(found.rows, stage="refined + kalman")
    assert {row["speed_m_s"] for row in ours} == {10.0} and all(row["found"] for row in ours)
    assert np.mean([float(str(row["centre_error_px"])) for row in ours]) < 0.4
    assert [table.title for table in found.tables[1:]] == ["Ball detector by scene", "Ball detector by speed"]


def test_noise_beside_the_ball_moves_no_label(made: SimulatedRecording) -> None:
    """Clumps of events that stick to the outline would pull at the hull by pixels."""
    random = np.random.default_rng(78_012)
    truth, count = made.truth, 3000
    t_us = np.sort(random.integers(int(truth.t_us[0]), int(truth.t_us[-1]), count))
    x, y, radius = (np.interp(t_us, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px))
    angle, beyond = random.uniform(0, 2 * np.pi, count), random.uniform(0, 3, count)
    columns = np.rint(x + (radius + beyond) * np.cos(angle)), np.rint(y + (radius + beyond) * np.sin(angle))
    inside = (columns[0] >= 0) & (columns[0] < 1280) & (columns[1] >= 0) & (columns[1] < 720)
    clumps = EventBatch(t_us, *(column.clip(0, 1279).astype(np.uint16) for column in columns), np.ones(count, bool))
    both = EventBatch.concatenate([made.events, clumps[np.flatnonzero(inside)]])
    labels = ball_labels(both[np.argsort(both.t_us, kind="stable")], SIZE)
    off_px, _ = errors_px(labels, truth)
    assert labels.t_us.size > 15 and off_px.mean() < 0.5 and off_px.max() < 1.2


def test_nothing_is_labelled_where_no_ball_flies(made: SimulatedRecording, tmp_path: Path) -> None:
    still = made.events[np.flatnonzero(made.truth.label == 0)]
    for events in (still, made.events[:0], made.events[:5]):
        with pytest.raises(RecordingError, match="no ball in flight leaves a blob"):
            ball_labels(events, SIZE)
    for text in ("t_us,x_px\n1,2\n", "", "t_us,x_px,y_px,radius_px,std_px,ball\n1,2,3,4,nan,1\n"):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(RecordingError, match="labels"):
            BallLabels.read(tmp_path / "bad.csv")


def test_labels_of_a_ball_that_speeds_up_are_its_places_in_the_middle_of_the_exposure() -> None:
    t_us, velocity, acceleration = 2500.0 * np.arange(12), np.array([0.004, -0.001]), np.array([1e-8, 2e-8])
    places = t_us[:, None] * velocity + t_us[:, None] ** 2 * acceleration / 2
    speeds = velocity + t_us[:, None] * acceleration
    directions = speeds / np.linalg.norm(speeds, axis=1)[:, None]
    middles = places + acceleration * EXPOSURE_US**2 / 8 - LAG_PX * directions
    blobs = [_Blob(*row, 40.0, 20.0) for row in zip(t_us.tolist(), middles, directions, strict=True)]
    found = _labels(blobs, 1)
    assert np.stack([found.x_px, found.y_px], axis=1) == pytest.approx(places, abs=0.005)
