"""The witnesses' picture: each one's axis, ellipse and range of magnitudes at the playhead, as the stage has them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.witnesses import DISC_RADIUS_PX, GAP_PX, MAX_RPS, NAMES, WIDTH_PX
from spinscope.pipeline.spin.combined.result import Witness
from tests.app.viewer.reading import Rows, read_back


@pytest.fixture(scope="module")
def logged(flight: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Rows]:
    path = tmp_path_factory.mktemp("witnesses") / "flight.rrd"
    write_rrd(flight, path, "spin")
    return read_back(path)


def strips(logged: dict[str, Rows], name: str, t_us: int) -> list[np.ndarray]:
    """The lines of one witness at a time."""
    lines = logged[f"{entities.WITNESSES}/{name}"].at("strips", t_us) or []
    return [np.array(line, float) for line in lines]


def on_discs(axis: np.ndarray) -> np.ndarray:
    """Place of an axis by its definition: x right and y down, on the left disc if it points towards the camera."""
    middle_px = DISC_RADIUS_PX if axis[2] < 0 else 3 * DISC_RADIUS_PX + GAP_PX
    return np.array([middle_px + DISC_RADIUS_PX * axis[0], DISC_RADIUS_PX + DISC_RADIUS_PX * axis[1]])


def test_axis_and_magnitude_stand_where_the_witness_has_them(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    shown = 0
    for tick in flight.ticks:
        for witness in tick.results["combined"].witnesses:
            if witness.magnitude_rps is None:  # it tells no spin by itself
                continue
            lines = strips(logged, witness.name, tick.packet.end_us)
            *_, bar, mark = lines
            np.testing.assert_allclose(mark[:, 0] * MAX_RPS / WIDTH_PX, witness.magnitude_rps, atol=1e-3)
            half_rps = (bar[1, 0] - bar[0, 0]) * MAX_RPS / WIDTH_PX / 2
            if witness.magnitude_rps - 2 * witness.magnitude_std_rps > 0:
                assert half_rps == pytest.approx(2 * witness.magnitude_std_rps, rel=1e-3, abs=1e-3)
            if witness.spin_rps is None:
                assert len(lines) == 2
                continue
            cross = lines[-4:-2]
            place = on_discs(witness.spin_rps / np.linalg.norm(witness.spin_rps))
            np.testing.assert_allclose(np.mean(cross, axis=(0, 1)), place, atol=1e-3)
            shown += 1
    assert shown > len(flight.ticks) / 2


def test_every_witness_has_a_row_and_its_odds_stand_there(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    said = [(tick.packet.end_us, one) for tick in flight.ticks for one in tick.results["combined"].witnesses]
    assert {one.name for _, one in said} <= set(NAMES)
    assert any(one.name == "logo" for _, one in said), "what was seen and not seen is a witness"
    for t_us, one in said:
        shown = logged[f"{entities.WITNESSES}/{one.name}/odds"].at("labels", t_us) or []
        assert list(shown) == [words for words in [one.odds] if words]


@pytest.mark.parametrize(
    ("log_odds", "words"),
    [
        (math.log(2.9), ""),
        (-math.log(2.9), ""),
        (math.log(20), "20 : 1 for it"),
        (-math.log(3000), "3,000 : 1 against it"),
        (1e4, "1,000,000 : 1 for it"),
    ],
)
def test_odds_in_words(log_odds: float, words: str) -> None:
    assert Witness("rate", None, None, None, None, log_odds).odds == words


def test_the_ellipse_is_two_sigma_of_the_axis(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = flight.ticks[-4]
    estimate = tick.results["combined"].estimate
    assert estimate.axis is not None and estimate.axis_std_deg is not None
    *ellipse, _, _, _, _ = strips(logged, "combined", tick.packet.end_us)
    points = np.concatenate(ellipse)
    right = points[:, 0] > 2 * DISC_RADIUS_PX + GAP_PX / 2
    x = (points[:, 0] - np.where(right, 2 * DISC_RADIUS_PX + GAP_PX, 0)) / DISC_RADIUS_PX - 1
    y = points[:, 1] / DISC_RADIUS_PX - 1
    z = np.where(right, 1, -1) * np.sqrt(np.maximum(1 - x * x - y * y, 0))
    off = np.degrees(np.arccos(np.clip(np.column_stack([x, y, z]) @ estimate.axis, -1, 1)))
    # Both half axes: their squares add up to (2 sigma)^2 of both directions together.
    assert math.hypot(off.max(), off.min()) == pytest.approx(2 * estimate.axis_std_deg, rel=0.1)


def test_a_witness_that_says_nothing_is_not_drawn(no_ball: ViewedRun, tmp_path: Path) -> None:
    write_rrd(no_ball, tmp_path / "run.rrd", "spin")
    logged = read_back(tmp_path / "run.rrd")
    for name in ("rate", "contrast", "trajectory", "combined"):
        assert strips(logged, name, no_ball.end_us) == []
