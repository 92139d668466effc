"""Calibration of a camera: a simulated blinking board, a ball and the table's corners tell what was simulated."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.calibration import COARSE_PERCENT, calibrate_by_ball, calibrate_by_board, calibrate_table
from spinscope.app.cli import cli
from spinscope.pipeline.calibration.board import Board, BoardView, board_views, flash_image
from spinscope.pipeline.calibration.camera_calibration import calibrate_camera, focal_length_px
from spinscope.pipeline.calibration.table_pose import table_pose
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recordings import ReadingOptions, write_recording
from spinscope.pipeline.recordings.in_memory import RecordingInMemory
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.sidecar import StatedTruth
from spinscope.pipeline.simulated_recordings import simulate_to_file
from spinscope.pipeline.simulator.board import SimulatedBoard, drawn_poses, simulate_board
from spinscope.pipeline.simulator.sensor import SensorModel

SIZE = 640, 360
BOARD = Board(9, 6, 20.0)
TRUE = Camera.of(
    CameraParameters(
        focal_length_mm=4.0, principal_x_px=326.5, principal_y_px=175.5, distortion=(-0.12, 0.08, 0.0008, -0.0005, 0.0)
    ),
    *SIZE,
)
ONE_EVENT = SensorModel(threshold_on=0.6, threshold_off=0.6, refractory_us=20_000.0)  # a pixel a flash: a coarse image


def simulated(poses: int, seed: int) -> SimulatedBoard:
    return simulate_board(drawn_poses(poses, camera=TRUE, seed=seed), camera=TRUE, sensor=ONE_EVENT, seed=seed)


@pytest.fixture(scope="module")
def made() -> SimulatedBoard:
    return simulated(14, 77_002)


def distortion_px(camera: Camera, rays: np.ndarray) -> np.ndarray:
    return camera.project(rays) - dataclasses.replace(camera, distortion=(0.0,) * 5).project(rays)


def corner_error_px(camera: Camera) -> float:
    """Largest error of the distortion in the image's corners."""
    rays = TRUE.rays(*np.array([(0, 0), (639, 0), (0, 359), (639, 359)], float).T)
    return float(np.linalg.norm(distortion_px(camera, rays) - distortion_px(TRUE, rays), axis=1).max())


def test_a_blinking_board_tells_the_camera(made: SimulatedBoard, tmp_path: Path) -> None:
    write_recording(tmp_path / "board.raw", made.events, width_px=SIZE[0], height_px=SIZE[1])
    (tmp_path / "none.raw").write_bytes(b"% evt 3.0\n% end\n")
    files = [tmp_path / "board.raw", tmp_path / "none.raw"]
    reading, out = ReadingOptions(sensor=SIZE), tmp_path / "camera.toml"
    said = calibrate_by_board(files, (9, 6), 20.0, "chessboard", 4.86, reading, out)
    assert said[0].startswith("left out:") and "none.raw" in said[0] and "reprojection error" in said[-2]
    assert (tmp_path / "camera.png").read_bytes().startswith(b"\x89PNG")
    camera = Camera.of(preset(tmp_path / "camera.toml").camera, *SIZE)
    assert camera.focal_px == pytest.approx(TRUE.focal_px, rel=0.006)
    principal_px = camera.principal_x_px, camera.principal_y_px
    assert principal_px == pytest.approx((TRUE.principal_x_px, TRUE.principal_y_px), abs=10.0)
    assert corner_error_px(camera) < 0.6  # of 14 views; see below


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "poses"), [(3, 24), (77_006, 40)])
def test_many_views_tell_focal_length_and_distortion_well(seed: int, poses: int) -> None:
    made = simulated(poses, seed)
    found = calibrate_camera(board_views(RecordingInMemory(made.events, *SIZE), BOARD), BOARD, SIZE)
    assert found.camera.focal_px == pytest.approx(TRUE.focal_px, rel=0.003)
    assert corner_error_px(found.camera) < 0.3


def test_a_pixel_is_the_brighter_the_sooner_it_responds() -> None:
    columns = np.repeat(np.arange(20, 320, 20), 2).astype(np.uint16)  # each responds twice: the first time counts
    t_us = np.repeat(1000 + 100 * np.arange(15), 2) + np.tile([0, 2000], 15)
    order = np.argsort(t_us, kind="stable")
    events = EventBatch(t_us[order], columns[order], np.full(30, 10, np.uint16), np.ones(30, bool))
    row = flash_image(events, (20, 340))[10].astype(float)
    assert np.all(np.diff(row[20:320:20]) <= 0) and row[20] > 4 * row[300] > 0 and row[30] == 0
    dark = EventBatch(events.t_us, events.x_px, events.y_px, ~events.on)
    assert not flash_image(dark, (20, 340)).any()


def test_corners_are_found_to_a_tenth_of_a_pixel(made: SimulatedBoard) -> None:
    first = made.events.between(0, 360_000)
    views = board_views(RecordingInMemory(first, *SIZE), BOARD)
    assert len(views) >= 3
    for view in views:
        true = made.corners_px[round((view.t_us - 50_000) / 100_000)]
        either_way = [np.linalg.norm(view.corners_px - corners, axis=1) for corners in (true, true[::-1])]
        assert np.sqrt(np.mean(np.square(min(either_way, key=np.max)))) < 0.1


def views_of(poses: int, middle: tuple[float, float], board: Board = BOARD) -> list[BoardView]:
    """Exact views round a place of the image."""
    random = np.random.default_rng(77_003)
    views = []
    for number in range(poses):
        turn = rotations(0.5 * random.uniform(-1, 1, 3))[0]
        place = TRUE.rays(*np.array(middle)[:, None])[0] * random.uniform(0.5, 0.7)
        points = (board.corners_mm - board.corners_mm.mean(axis=0)) * 1e-3 @ turn.T + place
        views.append(BoardView(number, np.arange(54), TRUE.project(points)))
    return views


def test_uncovered_corners_and_wrong_views_are_said() -> None:
    found = calibrate_camera(views_of(12, (320, 180)), BOARD, SIZE)
    assert found.camera.focal_px == pytest.approx(TRUE.focal_px, rel=1e-4) and found.reprojection_px < 0.01
    assert "top left, top right, bottom left, bottom right" in found.warnings[0]
    views = views_of(12, (320, 180))
    views[3].corners_px[:] += 3 * np.random.default_rng(77_004).standard_normal((54, 2))
    found = calibrate_camera(views, BOARD, SIZE)
    assert found.left_out == 1 and found.camera.focal_px == pytest.approx(TRUE.focal_px, rel=1e-4)
    with pytest.raises(RecordingError, match="seen in 4 different places: 5 or more"):
        calibrate_camera(views[:4], BOARD, SIZE)


def noisy(views: list[BoardView], std_px: np.ndarray, seed: int) -> list[BoardView]:
    """The views with corners off by so much, view by view."""
    off = np.random.default_rng(seed).standard_normal((len(views), 54, 2)) * std_px[:, None, None]
    return [dataclasses.replace(view, corners_px=view.corners_px + one) for view, one in zip(views, off, strict=True)]


def test_stated_errors_of_focal_length_and_corners_hold() -> None:
    exact, sigmas = views_of(15, (320, 180)), []
    for seed in range(77_020, 77_032):
        found = calibrate_camera(noisy(exact, np.full(15, 0.1), seed), BOARD, SIZE)
        off = corner_error_px(found.camera), abs(found.camera.focal_px - TRUE.focal_px)
        sigmas.append([off[0] / found.corner_std_px, off[1] / found.focal_std_px])
    root_mean_square = np.sqrt(np.mean(np.square(sigmas), axis=0))
    assert np.all((root_mean_square > 0.5) & (root_mean_square < 1.6))
    assert found.corner_std_px > 0.3 and "corners" in " ".join(found.warnings)


def test_views_count_by_how_well_they_are_seen() -> None:
    std_px = np.where(np.arange(15) % 3 == 0, 0.14, 0.03)  # as far apart as views of one recording are
    on_board = [BOARD.corners_mm.astype(np.float32)] * 15
    off = []
    for seed in range(77_040, 77_048):
        views = noisy(views_of(15, (320, 180)), std_px, seed)
        seen = [view.corners_px.astype(np.float32).reshape(-1, 1, 2) for view in views]
        flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3
        equal = cv2.calibrateCamera(on_board, seen, SIZE, np.eye(3), np.zeros(5), flags=flags)[1][0, 0]
        off.append(
            [focal_px - TRUE.focal_px for focal_px in (calibrate_camera(views, BOARD, SIZE).camera.focal_px, equal)]
        )
    weighted, equally = np.sqrt(np.mean(np.square(off), axis=0))
    assert weighted < 0.8 * equally


def test_a_part_of_a_charuco_board_is_enough() -> None:
    board = Board(9, 6, 20.0, "charuco")
    image = np.asarray(board.charuco().generateImage((1000, 700)))
    for seen, least in ((image, 54), (image[:, :500], 20)):
        found = board.find(np.ascontiguousarray(seen))
        assert found is not None and len(found[0]) >= least
        row, column = np.divmod(found[0], 9)
        assert np.allclose(found[1], np.column_stack([(column + 1) * 100, (row + 1) * 100]) - 0.5, atol=1.0)
    assert board.find(np.zeros((200, 200), np.uint8)) is None


def test_a_board_never_seen_is_said(made: SimulatedBoard) -> None:
    one = RecordingInMemory(made.events.between(0, 100_000), *SIZE)
    with pytest.raises(RecordingError, match=r"board of 8x5 inner corners .* is seen in none of 1 flashes"):
        board_views(one, Board(8, 5, 20.0))
    noise = RecordingInMemory(made.events.between(0, 40_000), *SIZE)
    with pytest.raises(RecordingError, match="nothing flashes"):
        board_views(noise, BOARD)
    with pytest.raises(ParameterError, match="3 to 100"):
        Board(2, 6, 20.0)


def test_focal_length_by_a_ball(tmp_path: Path) -> None:
    for place in ((0.0, 0.0, 1.7), (0.3, -0.2, 1.2)):
        circle = tuple(float(value[0]) for value in TRUE.silhouette(np.array([place]), 0.02))
        unknown = dataclasses.replace(TRUE, focal_px=1234.0)
        distance_m = float(np.linalg.norm(place))
        assert focal_length_px(circle, distance_m, 0.02, unknown) == pytest.approx(TRUE.focal_px, rel=1e-6)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="tells no focal length"):
        focal_length_px((320.0, 180.0, 20.0), 0.01, 0.02, TRUE)
    simulate_to_file("spinner", tmp_path / "ball.h5", seed=77_005, focal_length_mm=12.0)
    session = Session.open(tmp_path / "ball.h5", Choices())
    truth = session.truth
    assert truth is not None
    circle = float(truth.x_px[0]), float(truth.y_px[0]), float(truth.radius_px[0])
    distance_m = float(np.linalg.norm(truth.position_m[0]))
    calibrate_by_ball(tmp_path / "ball.h5", distance_m, 40.0, circle, 4.86, ReadingOptions(), tmp_path / "camera.toml")
    assert tomllib.loads((tmp_path / "camera.toml").read_text())["camera"]["focal_length_mm"] == pytest.approx(12.0)


def test_a_focal_length_by_a_ball_says_how_uncertain_it_is(samples: Path, tmp_path: Path) -> None:
    recording, out = samples / "own/spinner_side.h5", tmp_path / "camera.toml"
    session = Session.open(recording)
    assert session.truth is not None
    x, y, radius = session.truth.x_px[0], session.truth.y_px[0], session.truth.radius_px[0]
    distance_m = float(np.linalg.norm(session.truth.position_m[0]))

    def calibrated(circle: tuple[float, float, float] | str) -> tuple[float, float, str]:
        said = "\n".join(calibrate_by_ball(recording, distance_m, 40.0, circle, 4.86, ReadingOptions(), out))
        (percent,) = re.findall(r"\+- (\S+) %", said)
        return tomllib.loads(out.read_text())["camera"]["focal_length_mm"], float(percent), said

    focal_mm, percent, said = calibrated("auto")
    assert percent > COARSE_PERCENT and "warning: distances and speeds will be as uncertain" in said
    assert focal_mm == pytest.approx(8.0, rel=2 * percent / 100)
    _, percent, said = calibrated((x, y, 2 * radius))  # as of a ball at half the distance: its circle is as exact
    assert percent < COARSE_PERCENT and "warning" not in said


@pytest.mark.parametrize("seed", range(77_010, 77_014))
def test_table_pose(seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    turn = rotations(random.uniform(-0.4, 0.4, 3))[0]
    table_m = np.array([(-1.37, -0.7625, 0), (1.37, -0.7625, 0), (1.37, 0.7625, 0), (-1.37, 0.7625, 0)])
    place = np.array([0.1, -0.05, 4.0])
    order = np.roll(np.arange(4), random.integers(4))[:: random.choice([-1, 1])]
    corners = TRUE.project(table_m @ turn.T + place)[order]
    pose = table_pose([tuple(corner) for corner in corners], TRUE)
    assert pose.up == pytest.approx(-turn[:, 2], abs=1e-4) and pose.middle_m == pytest.approx(place, abs=1e-3)
    from_first = -np.sign(table_m[order[0], 0]) * turn[:, 0]  # along the long side, away from the first corner
    assert pose.along == pytest.approx(from_first, abs=1e-4) and np.linalg.det(pose.rotation) == pytest.approx(1.0)
    assert pose.rotation @ from_first == pytest.approx([0, 1, 0], abs=1e-4)
    assert pose.rotation @ -turn[:, 2] == pytest.approx([0, 0, 1], abs=1e-4)
    assert pose.height_m == pytest.approx(abs(place @ turn[:, 2]), abs=1e-3)
    with pytest.raises(ParameterError, match="in order round the table"):
        table_pose([tuple(corner) for corner in corners[[0, 2, 1, 3]]], TRUE)
    (tmp_path / "lens.toml").write_text("[camera]\nfocal_length_mm = 4.0\n")
    calibrate_table([tuple(corner) for corner in corners], str(tmp_path / "lens.toml"), SIZE, tmp_path / "up.toml")
    assert preset(tmp_path / "up.toml").camera.up == pytest.approx(-turn[:, 2], abs=0.05)  # without the distortion
    stated = {"spin_rps": [0.0, 0.0, 30.0], "camera_frame": "up.frame.toml"}  # of the table
    assert StatedTruth.of(stated, tmp_path).spin_rps == pytest.approx(-30 * turn[:, 2], abs=1.5)


def test_command_line_says_what_is_missing(tmp_path: Path) -> None:
    out = str(tmp_path / "camera.toml")
    for arguments, said in (
        (["a.raw", "--out", out], "give --board"),
        (["a.raw", "--board", "9x6", "--out", out], "--square-mm"),
        (["a.raw", "--board", "9", "--square-mm", "20", "--out", out], "like 9x6"),
        (["a.raw", "b.raw", "--ball-distance-m", "2", "--out", out], "give one FILE"),
    ):
        done = CliRunner().invoke(cli, ["calibrate", "camera", *arguments])
        assert done.exit_code == 2 and said in done.output
