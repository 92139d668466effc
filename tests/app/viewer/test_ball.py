"""The ball in space: its place, its attitude, its arrows; read back from the file."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.ball import _arrow
from spinscope.app.viewer.ball_projections import TEXTURE_PX
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun, shown_estimate
from tests.app.viewer.reading import Rows, read_back
from tests.reference.rotation import turned


@pytest.fixture(scope="module")
def logged(flight: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Rows]:
    path = tmp_path_factory.mktemp("rrd") / "flight.rrd"
    write_rrd(flight, path, "all")
    return read_back(path)


def test_the_ball_is_where_the_tracker_has_it(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    for tick in flight.ticks:
        if tick.track.has_ball:
            (place,) = logged[entities.BALL].at("translation", tick.packet.end_us)
            np.testing.assert_allclose(place, flight.centre_m(tick.track.mean)[0], rtol=1e-5)
            (on_image,) = logged[entities.BALL_PLACE].at("translation", tick.packet.end_us)
            np.testing.assert_allclose(on_image[:2], tick.track.mean[:2], rtol=1e-6)


def test_the_ball_turns_as_its_spin_says(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    """A millisecond after a tick the logged attitude has turned by the spin shown at that tick."""
    tick = flight.ticks[len(flight.ticks) // 2]
    estimate, _ = shown_estimate(tick)
    assert estimate is not None
    assert estimate.vector_rps is not None
    points = np.eye(3)

    def attitude(t_us: int) -> np.ndarray:
        (quaternion,) = logged[entities.BODY].at("quaternion", t_us)
        axis, sine = np.array(quaternion[:3]), np.linalg.norm(quaternion[:3])
        return turned(points, axis / sine, np.full(3, np.arctan2(sine, quaternion[3]) / np.pi))

    before, after = attitude(tick.packet.end_us), attitude(tick.packet.end_us + 1000)
    np.testing.assert_allclose(after, turned(before, estimate.vector_rps, np.full(3, 1e-3)), atol=1e-4)


def test_the_shown_arrow_points_along_the_trusted_spin(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    tick = [tick for tick in flight.ticks if tick.best is not None][-1]
    assert tick.best is not None
    estimate = tick.estimates[tick.best]
    (arrow,) = logged[entities.SPIN_SHOWN].at("vectors", tick.packet.end_us)
    np.testing.assert_allclose(np.array(arrow) / np.linalg.norm(arrow), estimate.axis, atol=1e-5)
    (label,) = logged[entities.SPIN_SHOWN].at("labels", tick.packet.end_us)
    is_final = flight.ticks.index(tick) in flight.final_shots
    assert label == f"{estimate.magnitude_rps:.1f} rps{'' if is_final else ', so far'}"
    (ring,) = np.array(logged[entities.SPIN_RING].at("strips", tick.packet.end_us))
    sense = np.cross(ring[0], ring[1]) @ estimate.axis
    assert sense > 0  # the ring runs the way the ball turns


def test_an_arrow_that_is_not_trusted_is_pale_and_says_so(flight: ViewedRun) -> None:
    vectors = [np.array([0.0, 0.0, 20.0])] * len(flight.ticks)
    notes = ["" if row % 2 == 0 else ", not trusted" for row in range(len(flight.ticks))]
    _, drawn = _arrow(flight, entities.SPIN_SHOWN, vectors, entities.RING_COLOUR, 0.06, notes)
    columns = drawn.to_record_batch().to_pydict()
    labels = next(value for name, value in columns.items() if name.endswith("labels"))
    colours = next(value for name, value in columns.items() if name.endswith("colors"))
    assert labels[1:3] == [["20.0 rps"], ["20.0 rps, not trusted"]]
    assert colours[1] != colours[2] and colours[1] == colours[3]


def test_the_path_is_the_ticks_places_in_pieces(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    for before, tick in zip(flight.ticks, flight.ticks[1:], strict=False):
        if before.track.has_ball and tick.track.has_ball:
            (piece,) = logged[entities.PATH].at("strips", tick.packet.end_us)
            means = np.stack([before.track.mean, tick.track.mean])
            np.testing.assert_allclose(piece, flight.centre_m(means), rtol=1e-5)


def test_a_texture_is_painted_for_every_tick_of_200_hz(flight: ViewedRun, logged: dict[str, Rows]) -> None:
    mesh = logged[entities.MESH]
    width, height = TEXTURE_PX
    assert len(mesh.values["albedo_texture_buffer"]) == 1 + int(flight.has_ball.sum())
    assert {len(buffer[0]) for buffer in mesh.values["albedo_texture_buffer"]} == {3 * width * height}
    first, last = (np.array(mesh.values["albedo_texture_buffer"][i][0]) for i in (0, -1))
    assert np.ptp(first.reshape(-1, 3), axis=0).max() == 0  # blank
    assert np.ptp(last) > 100  # the logo, dark on white
