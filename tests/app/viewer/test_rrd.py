"""What really stands in the .rrd file, read back from it."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import uuid
from pathlib import Path

import cv2
import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.plots import STATE
from spinscope.app.viewer.rerun_api import program, quiet_environment
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.views import VIEWS, View, views
from spinscope.pipeline.errors import RecordingError
from tests.app.viewer.reading import Rows, read_back

Logged = dict[str, Rows]

EVERYWHERE = {
    *(entities.FRAME, entities.EVENTS, entities.SURFACE, entities.HOUGH, entities.MEASURED, entities.KALMAN),
    *(entities.BALL_PLACE, entities.BALL_CENTRE, entities.LOGO, entities.LOGO_OUTLINE, entities.LOGO_MASK),
    *(
        entities.FLOW,
        entities.FLOW_WHEEL,
        entities.DEROTATED_LOGO,
        entities.STATUS,
        entities.SUMMARY,
        f"{entities.COACH}/0",
    ),
    *(entities.WORLD, entities.PATH, entities.AXES, entities.BALL, entities.MESH),
    *(entities.SPIN_SHOWN, entities.SPIN_RING, entities.RING_TIP),
    *(entities.UNROLLED, entities.GRATICULE, entities.SCORE_AXES, f"{entities.SCORE_MAGNITUDE}/score"),
}


@pytest.fixture(scope="module")
def flight_file(flight: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rrd") / "flight.rrd"
    write_rrd(flight, path, "all")
    return path


@pytest.fixture(scope="module")
def logged(flight_file: Path) -> Logged:
    return read_back(flight_file)


@pytest.fixture(scope="module", params=["flight", "spinner", "no_ball"])
def any_run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[ViewedRun, Path]:
    run: ViewedRun = request.getfixturevalue(request.param)
    path = tmp_path_factory.mktemp("rrd") / f"{request.param}.rrd"
    write_rrd(run, path, "all")
    return run, path


def test_rerun_itself_finds_no_fault(any_run: tuple[ViewedRun, Path]) -> None:
    command = [program(), "rrd", "verify", str(any_run[1])]
    done = subprocess.run(command, capture_output=True, text=True, env=quiet_environment(), check=False)
    assert done.returncode == 0, done.stderr
    assert any_run[1].stat().st_size < 15e6


def test_everything_begins_at_the_start_and_no_time_comes_twice(any_run: tuple[ViewedRun, Path]) -> None:
    run, logged = any_run[0], read_back(any_run[1])
    assert set(logged) >= EVERYWHERE
    for path, rows in logged.items():
        for component, t_us in rows.t_us.items():
            assert np.all(np.diff(t_us) > 0), (path, component)
            assert t_us[-1] <= run.end_us
            if path != f"{entities.RATE_CROSSINGS}/crossings":
                assert t_us[0] == run.start_us, (path, component)


def test_plots_span_the_run_even_without_a_ball(any_run: tuple[ViewedRun, Path]) -> None:
    run, logged = any_run[0], read_back(any_run[1])
    plots = [path for path in logged if path.startswith("/plots/") and not path.endswith("/crossings")]
    assert len(plots) > 15
    for path in plots:
        t_us = next(iter(logged[path].t_us.values()))
        assert t_us[-1] >= run.ends_us[-1] - 5000, path


def test_the_kalman_circle_is_the_filters_mean(flight: ViewedRun, logged: Logged) -> None:
    circle = logged[entities.KALMAN]
    assert not circle.at("centers", flight.start_us)
    for tick in flight.ticks:
        centres, halves = (circle.at(name, tick.packet.end_us) for name in ("centers", "half_sizes"))
        if tick.track.has_ball:
            np.testing.assert_allclose(centres, [tick.track.mean[:2]], rtol=1e-6)
            np.testing.assert_allclose(halves, [[tick.track.mean[4]] * 2], rtol=1e-6)
        else:
            assert not centres


def test_measured_circles_are_there_when_measured(flight: ViewedRun, logged: Logged) -> None:
    for tick in flight.ticks:
        for path, circle in ((entities.HOUGH, tick.track.hough), (entities.MEASURED, tick.track.measured)):
            centres = logged[path].at("centers", tick.packet.end_us)
            if circle is None:
                assert not centres
            else:
                np.testing.assert_allclose(centres, [[circle.x_px, circle.y_px]], rtol=1e-6)


def test_the_true_circle_is_dashed_around_the_true_centre(flight: ViewedRun, logged: Logged) -> None:
    assert flight.truth is not None
    tick = flight.ticks[10]
    dashes = np.array(logged[entities.TRUE_CIRCLE].at("strips", tick.packet.end_us))
    truth = [np.interp(tick.track.t_us, flight.truth.t_us, c) for c in (flight.truth.x_px, flight.truth.y_px)]
    np.testing.assert_allclose(dashes.mean(axis=(0, 1)), truth, atol=0.01)


def test_raw_events_are_all_there_in_their_colours(flight: ViewedRun, logged: Logged) -> None:
    events = logged[entities.EVENTS]
    for tick in flight.ticks[::5]:
        positions = np.array(events.at("positions", tick.packet.end_us))
        classes = np.array(events.at("class_ids", tick.packet.end_us))
        np.testing.assert_array_equal(positions[:, 0], tick.packet.events.x_px)
        np.testing.assert_array_equal(classes % 2, tick.packet.events.on)
        kept = tick.filter.surface_events
        marked = classes >= 2
        assert marked.sum() == len(kept)
        np.testing.assert_array_equal(positions[marked, 1], kept.y_px)


def test_the_surface_is_shown_as_it_is(flight: ViewedRun, logged: Logged) -> None:
    tick = flight.ticks[-3]
    (blob,) = logged[entities.SURFACE].at("blob", tick.packet.end_us)
    shown = cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(shown, tick.surface.values)
    assert logged[entities.SURFACE].static["translation"] == [[-0.5, -0.5, 0.0]]


def test_logo_events_are_in_the_balls_frame(flight: ViewedRun, logged: Logged) -> None:
    for tick in flight.ticks[4::6]:
        positions = np.array(logged[entities.LOGO].at("positions", tick.packet.end_us)).reshape(-1, 2)
        np.testing.assert_allclose(positions, np.column_stack([tick.logo.x_px, tick.logo.y_px]), atol=1e-4)


def test_the_state_lane_changes_when_the_tracker_does(flight: ViewedRun, logged: Logged) -> None:
    lane = logged[entities.STATUS]
    for tick in flight.ticks:
        assert lane.at("state", tick.packet.end_us) == [tick.track.status]


def test_the_plots_carry_values_and_variances(flight: ViewedRun, logged: Logged) -> None:
    for i, component in enumerate(STATE):
        rows = logged[f"{entities.PLOT}/{component.name}/kalman"]
        for tick in flight.ticks:
            (value,), (variance,) = (rows.at(c, tick.packet.end_us) for c in ("values", "variances"))
            np.testing.assert_allclose(value, tick.track.mean[i])
            if tick.track.has_ball:
                assert variance == pytest.approx(tick.track.covariance[i, i])
        assert rows.static["units"] == [component.unit]


def test_the_event_rate_is_the_last_ticks(flight: ViewedRun, logged: Logged) -> None:
    rate = max((tick.rate for tick in flight.ticks), key=lambda rate: rate.t_us.size)
    rows = logged[f"{entities.RATE}/histogram"]
    shown = [rows.at("scalars", int(t))[0] for t in rate.t_us]
    np.testing.assert_allclose(shown, rate.rate_hz / 1e3)
    crossings = logged[f"{entities.RATE_CROSSINGS}/crossings"]
    np.testing.assert_allclose(crossings.t_us["scalars"], rate.crossings_us, atol=1e-3)


def test_every_methods_spin_is_plotted(flight: ViewedRun, logged: Logged) -> None:
    tick = flight.ticks[-2]
    for method, estimate in tick.estimates.items():
        (value,) = logged[f"{entities.SPIN_MAGNITUDE}/{method}"].at("values", tick.packet.end_us)
        np.testing.assert_allclose(value, np.nan if estimate.magnitude_rps is None else estimate.magnitude_rps)


def test_without_truth_nothing_claims_to_be_true(flight: ViewedRun, tmp_path: Path) -> None:
    write_rrd(dataclasses.replace(flight, truth=None), tmp_path / "untold.rrd", "all")
    assert not [path for path in read_back(tmp_path / "untold.rrd") if "tru" in path]


@pytest.mark.parametrize("view", views(), ids=lambda view: view.name)
def test_the_blueprint_has_all_tabs_paused_in_slow_motion(no_ball: ViewedRun, tmp_path: Path, view: View) -> None:
    write_rrd(no_ball, tmp_path / "run.rrd", view.name)
    logged = read_back(tmp_path / "run.rrd", blueprint=True)
    containers = {path: rows.static for path, rows in logged.items() if path.startswith("/container/")}
    names = {path: static["display_name"][0] for path, static in containers.items() if "display_name" in static}
    assert {tab.label for tab in VIEWS if not tab.compares} <= set(names.values())
    assert "Compare" not in names.values()
    root = logged["/viewport"].static["root_container"][0]
    front = logged[f"/container/{uuid.UUID(bytes=bytes(root))}"].static["active_tab"][0]
    assert names[f"/{front.strip('/')}"] == view.label
    time_panel = logged["/time_panel"].static
    assert time_panel["playback_speed"] == [0.01]
    assert time_panel["timeline"] == ["t"]
    assert time_panel["play_state"] == [1]  # paused


def test_a_failed_write_leaves_the_old_file_and_no_litter(
    flight: ViewedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"precious")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(RecordingError, match=r"No space left on device.*free space"):
        write_rrd(flight, path, "all")
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    assert path.read_bytes() == b"precious"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_told_at_once(no_ball: ViewedRun, tmp_path: Path) -> None:
    """Rerun's own writer tells nobody, or waits for ever."""
    (tmp_path / "run.rrd").symlink_to("/dev/full")
    with pytest.raises(RecordingError, match="No space left on device"):
        write_rrd(no_ball, tmp_path / "run.rrd", "all")
    assert (tmp_path / "run.rrd").readlink() == Path("/dev/full")


def test_rerun_switched_off_by_its_variables_still_writes(samples: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.rrd"
    command = ["view", str(samples / "spinner_ball5_back_no_logo.h5"), "--window", "0", "30000", "--save", str(out)]
    variables = {"RERUN": "off", "_RERUN_TEST_FORCE_SAVE": str(tmp_path / "other.rrd"), "RERUN_STRICT": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "spinscope", *command, "--fixed-ball", "606.67", "302.79", "16.47"],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 100_000 and not (tmp_path / "other.rrd").exists()


def test_a_folder_that_is_not_there_is_named(no_ball: ViewedRun, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"its folder does not exist.*missing/run\.rrd"):
        write_rrd(no_ball, tmp_path / "missing" / "run.rrd", "all")


def test_the_viewer_is_loaded_only_when_it_is_needed() -> None:
    code = "import sys, spinscope.app.viewer, spinscope.app.cli; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
