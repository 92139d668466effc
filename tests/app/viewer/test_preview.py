"""Preview of a tick: what its panes show."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from spinscope.app.viewer import entities
from spinscope.app.viewer.preview import SIDE_PX, TITLES, _turned, preview, preview_words
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.tick import Tick


def panes(content: bytes) -> list[np.ndarray]:
    """RGB panes of a preview."""
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert picture.shape == (SIDE_PX, len(TITLES) * SIDE_PX, 3)
    return np.split(picture, len(TITLES), axis=1)


def events_in(pane: np.ndarray) -> int:
    """Number of pixels in the colours of the polarities."""
    return sum(int((pane == colour).all(axis=2).sum()) for colour in (entities.ON, entities.OFF))


def test_every_pane_shows_the_ball(flight: ViewedRun) -> None:
    last = max(row for row, tick in enumerate(flight.ticks) if tick.best is not None)
    surface, logo, flow, derotated = panes(preview(flight.ticks[: last + 1]))
    green = np.array(entities.KALMAN_COLOUR)
    for pane in (surface, logo, flow, derotated):
        assert (np.abs(pane.astype(int) - green).sum(axis=2) < 120).sum() > SIDE_PX  # the circle
    of_tick, of_shot = (events_in(pane) for pane in (logo, derotated))
    assert of_shot >= of_tick > 0
    assert preview_words(flight.ticks[last], is_whole=True).endswith("rps so far")


def test_without_a_ball_it_is_black_and_says_why(flight: ViewedRun) -> None:
    seen = flight.ticks[0]
    lost = dataclasses.replace(seen.track, status="lost", reason="no ball: no circle in the surface", balls=())
    before = Tick({**seen.results, "track": lost}, seen.packet, ())
    assert not np.concatenate(panes(preview([before]))).any()
    assert preview_words(before, is_whole=True) == "No ball: no circle in the surface"


def test_a_quarter_of_a_turn_takes_x_to_y() -> None:
    turned = _turned(np.array([[1.0, 0, 0]]), np.array([0, 0, 5.0]), np.array([0.05]))
    np.testing.assert_allclose(turned, [[0, 1, 0]], atol=1e-12)
    np.testing.assert_array_equal(_turned(turned, np.zeros(3), np.array([1.0])), turned)
