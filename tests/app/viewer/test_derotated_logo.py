"""The logo unrolled: in its place on the map, sharp when the spin is right."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.app.viewer import derotated_logo, entities
from spinscope.app.viewer.ball_projections import MAP_PX, map_directions, map_frame
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from tests.app.viewer.conftest import with_results
from tests.app.viewer.reading import read_back
from tests.reference.rotation import turned

numbers = st.floats(-1, 1, allow_nan=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(spin=vectors, middle=vectors)
@settings(max_examples=100, deadline=None)
def test_the_maps_frame_is_right_handed_about_the_axis(spin: np.ndarray, middle: np.ndarray) -> None:
    frame = map_frame(60 * spin, middle)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(frame) == pytest.approx(1)
    np.testing.assert_allclose(frame[2], spin / np.linalg.norm(spin), atol=1e-9)
    assert frame[0] @ middle >= -1e-6 * np.linalg.norm(middle)  # a middle on the pole has any longitude


def test_without_a_spin_or_with_the_logo_on_the_pole_there_is_a_map_all_the_same() -> None:
    for spin, middle in ((np.zeros(3), np.array([0, 0, -1.0])), (np.array([0, 0, 9.0]), np.array([0, 0, 1.0]))):
        frame = map_frame(spin, middle)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-9)


def test_a_point_on_the_ball_moves_right_on_the_map() -> None:
    """Longitude grows in the sense of the spin, and the axis is up."""
    width, height = MAP_PX
    directions = map_directions()
    assert directions.shape == (height, width, 3)
    np.testing.assert_allclose(directions[0].mean(axis=0), [0, 0, 1], atol=0.02)
    here = directions[height // 2, width // 2]
    there = turned(here[None], np.array([0.0, 0.0, 1.0]), np.array([10 / width]))[0]
    np.testing.assert_allclose(there, directions[height // 2, width // 2 + 10], atol=1e-6)


def strength(run: ViewedRun, path: Path) -> np.ndarray:
    """(height, width) how strongly the last map is coloured, its sum 1."""
    write_rrd(run, path, "spin")
    picture = read_back(path)[entities.UNROLLED].picture(run.end_us).astype(float)
    coloured = np.ptp(picture, axis=2) - np.ptp(picture[0, 0])
    return coloured.clip(0) / coloured.clip(0).sum()


def test_the_map_is_sharp_when_the_spin_is_right(flight: ViewedRun, tmp_path: Path) -> None:
    """With the spin 4 % off, the logo's events are spread over several times the area."""

    def wrong(share: float) -> ViewedRun:
        ticks = []
        for tick in flight.ticks:
            assert tick.contrast is not None
            estimate = tick.contrast.estimate
            if estimate.vector_rps is not None:
                estimate = dataclasses.replace(estimate, vector_rps=share * estimate.vector_rps)
            ticks.append(with_results(tick, contrast=dataclasses.replace(tick.contrast, estimate=estimate)))
        return dataclasses.replace(flight, ticks=ticks)

    sharp, smeared = (strength(run, tmp_path / "run.rrd") for run in (flight, wrong(1.04)))
    assert (sharp**2).sum() > 2 * (smeared**2).sum()
    across, width = sharp.sum(axis=0), sharp.shape[1]
    middle = across[width // 4 : 3 * width // 4].sum()
    assert middle > 0.9, "the logo is in the middle of the map"


def test_a_long_run_has_fewer_pictures_and_one_at_its_shots_end_all_the_same(
    flight: ViewedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pictured_us() -> np.ndarray:
        write_rrd(flight, tmp_path / "run.rrd", "spin")
        return read_back(tmp_path / "run.rrd")[entities.UNROLLED].t_us["buffer"]

    every = pictured_us()
    assert len(every) >= flight.has_ball.sum()
    monkeypatch.setattr(derotated_logo, "MAX_PICTURES", 5)
    few = pictured_us()
    assert 4 <= len(few) <= 5 + 2
    assert few[0] == flight.start_us
    assert few[-1] == every[-1] == flight.shots[0].end_us
