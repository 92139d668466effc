"""The run in words: numbers, kinds, reasons; at the right moments."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.summary import _TickState
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.results import MethodResult
from spinscope.pipeline.spin_terms import kind_of_spin
from tests.app.viewer.conftest import with_results
from tests.app.viewer.reading import Rows, read_back


def logged_by(run: ViewedRun, folder: Path) -> dict[str, Rows]:
    write_rrd(run, folder / "run.rrd", "coach")
    return read_back(folder / "run.rrd")


def said(logged: dict[str, Rows], t_us: int) -> str:
    (text,) = logged[entities.SUMMARY].at("text", t_us)
    return str(text)


@pytest.fixture(scope="module")
def logged(flight: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Rows]:
    return logged_by(flight, tmp_path_factory.mktemp("rrd"))


def test_before_the_ball_it_says_so(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    assert said(logged, flight.start_us).startswith("## No ball yet")
    assert flight.name in said(logged, flight.start_us)


def test_the_shots_end_tells_the_shot(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    (shot,) = flight.shots
    assert shot.best is not None
    best = shot.estimates[shot.best]
    assert best.vector_rps is not None
    assert best.magnitude_rps is not None
    velocity = shot.velocity_m_s(flight.camera, flight.ball_radius_m)
    assert velocity is not None
    text = said(logged, shot.end_us)
    kind = kind_of_spin(best.vector_rps, velocity, flight.camera.up).name
    assert text.startswith(f"## {best.magnitude_rps:.1f} rps · {kind}")
    speed = np.linalg.norm(velocity)
    for words in (f"{60 * best.magnitude_rps:.0f} rpm", f"{speed:.1f} m/s", f"{3.6 * speed:.0f} km/h", "shot 1 of 1"):
        assert words in text
    for method in shot.estimates:
        assert STAGES[method].label in text
    assert f"{STAGES[shot.best].label} ✔" in text
    assert "from the truth" in text


def test_every_tick_speaks_of_its_own_estimate(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    for tick in flight.ticks[:-1]:
        text = said(logged, tick.packet.end_us)
        if tick.best is not None and "so far" in text:
            assert text.startswith(f"## {tick.estimates[tick.best].magnitude_rps:.1f} rps")
        for estimate in tick.estimates.values():
            if tick.track.has_ball and estimate.reason and "so far" in text:
                assert f"refused: {estimate.reason}" in text


def test_a_ball_in_place_has_an_axis_and_no_speed(spinner: ViewedRun, tmp_path: Path) -> None:
    text = said(logged_by(spinner, tmp_path), spinner.end_us)
    assert "In place" in text or "in place" in text
    assert "m/s" not in text
    assert "topspin" not in text


def test_no_ball_says_why(no_ball: ViewedRun, tmp_path: Path) -> None:
    assert no_ball.no_shot_reason
    logged = logged_by(no_ball, tmp_path)
    text = said(logged, no_ball.start_us)
    assert text.startswith("## No shot in this recording")
    assert no_ball.no_shot_reason in text.replace("**No ball", "no ball")
    for tick in no_ball.ticks:
        assert tick.track.reason in said(logged, tick.packet.end_us)
        assert all(line.lower().count("no ball") <= 1 for line in said(logged, tick.packet.end_us).splitlines())
    assert "5,000,000 to" in text  # the file's own time


def vague(result: MethodResult) -> MethodResult:
    """The same answer with a hundred times the uncertainty."""
    estimate = result.estimate
    if estimate.covariance_rps2 is None:
        return result
    return MethodResult(dataclasses.replace(estimate, covariance_rps2=1e4 * estimate.covariance_rps2))


def test_doubt_and_warnings_are_said(flight: ViewedRun, tmp_path: Path) -> None:
    ticks = [
        with_results(
            tick, triplet=vague(tick.triplet), normal_flow=vague(tick.normal_flow), contrast=None, combined=None
        )
        for tick in flight.ticks
    ]
    doubtful = dataclasses.replace(flight, ticks=ticks, shots=[], warnings=["seven hot pixels"])
    text = said(logged_by(doubtful, tmp_path), flight.ticks[12].packet.end_us)
    assert "no method is trusted" in text
    assert "seven hot pixels" in text
    card = _TickState(doubtful, ticks[12], None, None).card("so far")
    assert (card[0][0], card[2][0]) == ("-", "Spin not known"), "big numbers are trusted ones"


def block(logged: dict[str, Rows], number: int, t_us: int) -> np.ndarray:
    """One of the card's blocks, grey values."""
    (blob,) = logged[f"{entities.COACH}/{number}"].at("blob", t_us)
    return cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_GRAYSCALE)


def test_the_card_changes_with_the_shot(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    for number in range(2):
        first, last = (block(logged, number, t_us) for t_us in (flight.start_us, flight.shots[0].end_us))
        assert first.shape == last.shape
        assert (last > 200).sum() > 1.3 * (first > 200).sum()  # letters where dashes were


def test_blocks_of_the_card_lie_below_each_other(logged: dict[str, Rows]) -> None:
    height, _ = block(logged, 0, 0).shape
    for number in range(3):
        assert logged[f"{entities.COACH}/{number}"].static["translation"] == [[0, number * height, 0]]
