"""The sample recordings: whole, small, described, and Spinscope's own made again bit for bit."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sample_recordings.make import FOLDER, SAMPLES, make
from spinscope.pipeline.biases import FACTORY, PAPER
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.simulated_recordings import BIASES, DESCRIPTION
from spinscope.pipeline.simulator import Scene, SensorModel
from spinscope.pipeline.simulator.segments import Segment

FOREIGN = sorted(FOLDER.parent.glob("*.h5"))
OWN = [FOLDER / f"{name}.h5" for name in SAMPLES]
TRUTH_COLUMNS = ("t_us", "x_px", "y_px", "radius_px", "position_m", "velocity_m_s", "spin_rps", "label")


def test_the_script_makes_what_is_there() -> None:
    assert sorted(OWN) == sorted(FOLDER.glob("*.h5"))
    assert len(OWN) >= 8
    assert sum(path.stat().st_size for path in (*FOREIGN, *OWN)) < 10e6


@pytest.mark.parametrize("path", [*FOREIGN, *OWN], ids=lambda path: path.stem)
def test_every_sample_has_its_line_and_a_complete_truth(path: Path) -> None:
    line = next(line for line in (FOLDER.parent / "README.md").read_text().splitlines() if f"`{path.name}`" in line)
    recording = open_recording(path)
    events, truth = recording.read(), recording.truth
    assert truth is not None
    assert f" {len(events):,} " in line and f"{np.count_nonzero(truth.label == 2):,}" in line
    assert truth.label.size == len(events) and set(np.unique(truth.label)) <= {0, 1, 2, 3, 4}
    assert truth.t_us.size > 50 and np.all(np.diff(truth.t_us) > 0)
    for name in TRUTH_COLUMNS[1:-1]:
        column = getattr(truth, name)
        assert len(column) == truth.t_us.size and np.all(np.isfinite(column))
    assert np.all(truth.radius_px > 10)
    # Events of the ball come while the truth knows it: within the latency of a few milliseconds.
    of_ball = events.t_us[np.isin(truth.label, (1, 2))]
    late = of_ball - truth.t_us[np.maximum(np.searchsorted(truth.t_us, of_ball, side="right") - 1, 0)]
    assert np.percentile(late, 99) < 1000 and late.max() < 10_000


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_our_own_hold_scene_seed_and_biases(path: Path) -> None:
    recording = open_recording(path)
    description = json.loads(str(recording.attributes[DESCRIPTION]))
    options = SAMPLES[path.stem][1]
    assert description["seed"] == options["seed"]
    biases = FACTORY if path.stem == "shot_factory_biases" else PAPER
    assert json.loads(str(recording.attributes[BIASES])) == description["biases"] == biases.as_dict()
    assert SensorModel(**description["sensor"]) == SensorModel.of(biases)
    scene = Scene.from_dict(description["scene"])
    truth = recording.truth
    assert truth is not None
    for motion in scene.balls[0].motions:
        row = np.searchsorted(truth.t_us, motion.start_s * 1e6)
        np.testing.assert_allclose(truth.spin_rps[row], motion.spin_rps)
    motions = scene.balls[0].motions
    pauses = sum(after.start_s > before.end_s for before, after in itertools.pairwise(motions))
    assert np.count_nonzero(np.diff(truth.t_us) > 500) == pauses == (options.get("shots", 1) - 1)
    found = [Segment(**segment) for segment in description["segments"]]
    assert {segment.ball for segment in found} == set(range(len(scene.balls)))
    assert len(found) >= len(motions)


def test_the_smallest_is_made_again_bit_for_bit(tmp_path: Path) -> None:
    smallest = min(OWN, key=lambda path: path.stat().st_size)
    again = open_recording(make(smallest.stem, tmp_path).path)
    kept = open_recording(smallest)
    for column in ("t_us", "x_px", "y_px", "on"):
        assert getattr(again.read(), column).tobytes() == getattr(kept.read(), column).tobytes()
    assert again.truth is not None and kept.truth is not None
    for name in TRUTH_COLUMNS:
        assert getattr(again.truth, name).tobytes() == getattr(kept.truth, name).tobytes()
    assert _rounded(again.attributes) == _rounded(kept.attributes)


def _rounded(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes with the scene's numbers to twelve places: LAPACK's last bits are not the same on every processor."""
    scene = json.loads(attributes["simulation"], parse_float=lambda text: round(float(text), 12))
    return {**attributes, "simulation": scene}
