"""The score's pictures: the stage's own numbers at the playhead, best and rivals where the search has them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.score import CELL_PX, DISC_RADIUS_PX, GAP_PX
from spinscope.pipeline.tick import Tick
from tests.app.viewer.conftest import with_results
from tests.app.viewer.reading import Rows, read_back

RIVALS = np.array([[20.0, 0.0, -30.0], [0.0, 40.0, 5.0]])


def with_rivals(tick: Tick) -> Tick:
    """The tick with two rivals, where contrast has a best spin."""
    result = tick.contrast
    if result is None or not result.magnitudes_rps.size:
        return tick
    return with_results(tick, contrast=dataclasses.replace(result, rivals_rps=RIVALS, rival_sigmas=np.ones(2)))


@pytest.fixture(scope="module")
def rivalled(flight: ViewedRun) -> ViewedRun:
    return dataclasses.replace(flight, ticks=[with_rivals(tick) for tick in flight.ticks])


@pytest.fixture(scope="module")
def logged(rivalled: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Rows]:
    path = tmp_path_factory.mktemp("score") / "flight.rrd"
    write_rrd(rivalled, path, "spin")
    return read_back(path)


def numbers(rows: Rows, component: str, t_us: int) -> np.ndarray:
    """A row of bars' places, heights or widths."""
    (value,) = rows.at(component, t_us) if component != "widths" else (rows.at(component, t_us),)
    return np.array(value if component == "widths" else value["buffer"])


def test_the_curve_is_the_stages(rivalled: ViewedRun, logged: dict[str, Rows]) -> None:
    shown = 0
    for tick in rivalled.ticks:
        assert tick.contrast is not None
        curve = logged[f"{entities.SCORE_MAGNITUDE}/score"]
        places, heights = (numbers(curve, name, tick.packet.end_us) for name in ("abscissa", "values"))
        if tick.contrast.magnitudes_rps.size:
            np.testing.assert_allclose(places, tick.contrast.magnitudes_rps)
            np.testing.assert_allclose(heights, tick.contrast.magnitude_scores)
            shown += 1
        else:
            assert not heights.any()
    assert shown > len(rivalled.ticks) / 2


def test_best_and_rivals_stand_at_their_magnitudes(rivalled: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = rivalled.ticks[-3]
    assert tick.contrast is not None
    best = logged[f"{entities.SCORE_MAGNITUDE}/best"]
    np.testing.assert_allclose(numbers(best, "abscissa", tick.packet.end_us), [np.linalg.norm(tick.contrast.best_rps)])
    rivals = logged[f"{entities.SCORE_MAGNITUDE}/rivals"]
    np.testing.assert_allclose(numbers(rivals, "abscissa", tick.packet.end_us), np.linalg.norm(RIVALS, axis=1))
    assert (numbers(rivals, "values", tick.packet.end_us) < 0).all(), "below the curve: their axes are others"


def test_the_other_methods_answers_are_marked(rivalled: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = rivalled.ticks[-3]
    for method in ("triplet", "normal_flow"):
        magnitude_rps = tick.estimates[method].magnitude_rps
        marks = logged[f"{entities.SCORE_MAGNITUDE}/{method}"]
        np.testing.assert_allclose(numbers(marks, "abscissa", tick.packet.end_us), [magnitude_rps])


def test_axes_lie_on_the_disc_of_their_side(rivalled: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = rivalled.ticks[-3]
    places = np.array(logged[f"{entities.SCORE_AXES}/rivals"].at("positions", tick.packet.end_us))
    axes = RIVALS / np.linalg.norm(RIVALS, axis=1)[:, None]
    left = np.array([DISC_RADIUS_PX, DISC_RADIUS_PX]) + DISC_RADIUS_PX * axes[0, :2]
    right = np.array([3 * DISC_RADIUS_PX + GAP_PX, DISC_RADIUS_PX]) + DISC_RADIUS_PX * axes[1, :2]
    np.testing.assert_allclose(places, [left, right], rtol=1e-5)


def test_the_map_of_axes_is_lightest_at_the_best(rivalled: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = rivalled.ticks[-3]
    picture = logged[f"{entities.SCORE_AXES}/score"].picture(tick.packet.end_us).mean(axis=2)
    ((x, y),) = np.array(logged[f"{entities.SCORE_AXES}/best"].at("positions", tick.packet.end_us)) / CELL_PX
    around = picture[max(int(y) - 3, 0) : int(y) + 4, max(int(x) - 3, 0) : int(x) + 4]
    assert around.max() > 0.85 * picture.max()
    assert np.median(picture) < 0.6 * picture.max()


def test_nothing_is_claimed_without_contrast(flight: ViewedRun, tmp_path: Path) -> None:
    ticks = [with_results(tick, contrast=None, combined=None) for tick in flight.ticks]
    write_rrd(dataclasses.replace(flight, ticks=ticks, truth=None), tmp_path / "run.rrd", "spin")
    logged = read_back(tmp_path / "run.rrd")
    for entity in (f"{entities.SPIN_MAGNITUDE}/contrast", entities.SCORE_MAGNITUDE, entities.SCORE_AXES):
        assert not [path for path in logged if path.startswith(entity)]
