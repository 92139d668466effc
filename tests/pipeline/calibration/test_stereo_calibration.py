"""A frame camera beside the event camera: found by simulated views of the same board, and used for spins."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.calibration.board import Board, BoardView
from spinscope.pipeline.calibration.stereo_calibration import calibrate_stereo
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.sidecar import Sidecar
from spinscope.pipeline.simulator.board import BoardPose, drawn_poses, share_of_white, simulate_board
from spinscope.pipeline.simulator.sensor import Lens, SensorModel

BOARD = Board(9, 6, 20.0)
OPTICS = CameraParameters(focal_length_mm=4.0, distortion=(-0.12, 0.08, 0.0008, -0.0005, 0.0))
EVENT = Camera.of(OPTICS, 640, 360)
FRAME = Camera.of(CameraParameters(focal_length_mm=4.2, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0)), 960, 600)
ROTATION = rotations(np.radians([3.0, -6.0, 4.0]))[0]
SHIFT_M = np.array([-0.06, 0.002, 0.01])


def seen_by_frame_camera(pose: BoardPose) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and shift in m from the board to the frame camera."""
    return ROTATION @ rotations(np.array(pose.turn_rad))[0], ROTATION @ pose.shift_m + SHIFT_M


def pairs(count: int, seed: int, noise_px: float) -> list[tuple[BoardView, BoardView]]:
    random = np.random.default_rng(seed)
    made = []
    for number, pose in enumerate(drawn_poses(count, camera=EVENT, seed=seed)):
        points_m = BOARD.corners_mm * 1e-3
        event = EVENT.project(points_m @ rotations(np.array(pose.turn_rad))[0].T + pose.shift_m)
        turn, shift = seen_by_frame_camera(pose)
        frame = FRAME.project(points_m @ turn.T + shift)
        if random.random() < 0.5:  # a chessboard's corners may be counted from either end
            frame = frame[::-1]
        noisy = (places + noise_px * random.standard_normal(places.shape) for places in (event, frame))
        made.append((BoardView(number, np.arange(54), next(noisy)), BoardView(number, np.arange(54), next(noisy))))
    return made


def off_deg(rotation: np.ndarray) -> float:
    return float(np.degrees(np.linalg.norm(cv2.Rodrigues(rotation @ ROTATION.T)[0])))


def test_exact_views_give_the_exact_place() -> None:
    found = calibrate_stereo(pairs(5, 77_200, 0.0), BOARD, EVENT, FRAME)
    assert off_deg(found.rotation) < 5e-3 and found.shift_m == pytest.approx(SHIFT_M, abs=1e-4)
    assert found.pairs == 5 and not found.warnings and found.reprojection_px < 0.01


def test_rotation_is_found_to_a_fifth_of_a_degree_and_its_error_is_stated_right() -> None:
    sigmas = []
    for seed in range(77_201, 77_206):
        found = calibrate_stereo(pairs(8, seed, 0.15), BOARD, EVENT, FRAME)
        assert off_deg(found.rotation) < 0.2
        sigmas.append(off_deg(found.rotation) / found.rotation_std_deg)
    assert 0.3 < float(np.sqrt(np.mean(np.square(sigmas)))) < 2.5


def test_a_board_that_moved_between_the_cameras_is_left_out() -> None:
    made = pairs(8, 77_220, 0.1)
    event, frame = made[2]
    made[2] = event, dataclasses.replace(frame, corners_px=pairs(8, 77_221, 0.1)[3][1].corners_px)
    found = calibrate_stereo(made, BOARD, EVENT, FRAME)
    assert found.left_out == 1 and off_deg(found.rotation) < 0.2
    with pytest.raises(RecordingError, match="in 3 poses: 4 or more"):
        calibrate_stereo(made[:3], BOARD, EVENT, FRAME)


def test_recordings_and_pictures_of_a_folder(tmp_path: Path) -> None:
    sensor = SensorModel(threshold_on=0.6, threshold_off=0.6, refractory_us=20_000.0)
    x, y = np.meshgrid(np.arange(FRAME.width_px), np.arange(FRAME.height_px))
    rays = FRAME.rays(x.ravel(), y.ravel()).reshape(FRAME.height_px, FRAME.width_px, 3)
    (tmp_path / "poses").mkdir()
    for number, pose in enumerate(drawn_poses(6, camera=EVENT, seed=77_230)):
        made = simulate_board([pose], camera=EVENT, sensor=sensor, seed=77_230 + number)
        write_recording(tmp_path / "poses" / f"{number}.raw", made.events, width_px=640, height_px=360)
        turn, shift = seen_by_frame_camera(pose)
        (a, b, c), (u, v, w) = cv2.Rodrigues(turn)[0].ravel().tolist(), shift.tolist()
        of_frame = BoardPose((a, b, c), (u, v, w))
        white = share_of_white(rays, of_frame, 9, 6, 0.02, Lens())
        cv2.imwrite(str(tmp_path / "poses" / f"{number}.png"), (20 + 200 * white).astype(np.uint8))
    (tmp_path / "poses" / "4.png").unlink()
    for name, camera in (("event", EVENT), ("frame", FRAME)):
        values = {"focal_length_mm": camera.focal_px * 4.86 / 1000, "distortion": list(camera.distortion)}
        (tmp_path / f"{name}.toml").write_text(tomli_w.dumps({"camera": values}))
    named = {"--camera": "event.toml", "--frame-camera": "frame.toml", "--out": "stereo.toml"}
    options = [part for option, name in named.items() for part in (option, str(tmp_path / name))]
    arguments = [str(tmp_path / "poses"), "--board", "9x6", "--square-mm", "20", "--sensor", "640x360"]
    done = CliRunner().invoke(cli, ["calibrate", "stereo", *arguments, *options])
    assert done.exit_code == 0, done.output
    assert "left out: the picture cannot be read" in done.output and "pairs, reprojection" in done.output
    spin = np.array([10.0, 20.0, -40.0])
    in_frame_camera = ", ".join(map(str, ROTATION @ spin))
    (tmp_path / "shot.toml").write_text(f'[truth]\nspin_rps = [{in_frame_camera}]\ncamera_frame = "stereo.toml"\n')
    truth = Sidecar.beside(tmp_path / "shot.raw").truth
    assert truth is not None and truth.rps == pytest.approx(np.linalg.norm(spin))
    cosine = np.array(truth.spin_rps) @ spin / np.linalg.norm(spin) ** 2
    assert np.degrees(np.arccos(cosine)) < 0.2
    (tmp_path / "stereo.toml").write_text("[stereo]\nrotation = [[1, 2, 3], [0, 1, 0], [0, 0, 1]]\n")
    with pytest.raises(ParameterError, match="names no rotation from the camera's frame"):
        Sidecar.beside(tmp_path / "shot.raw")
