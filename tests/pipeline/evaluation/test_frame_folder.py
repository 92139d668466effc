"""Pictures of a frame camera beside a recording: read, and their spin beside the event camera's."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.evaluation import TaskContext
from spinscope.pipeline.evaluation.frame_camera import FrameCamera, frames
from spinscope.pipeline.evaluation.frame_folder import FrameFolder, frame_camera_beside
from spinscope.pipeline.evaluation.real_recordings import evaluate_real
from spinscope.pipeline.evaluation.rendering import render
from spinscope.pipeline.evaluation.suites.frames import FRAME, STEREO
from spinscope.pipeline.evaluation.tables import where
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.simulator import thrown
from spinscope.pipeline.simulator.background import intensity_map

SIZE = 320, 200


def disc_pictures(folder: Path, names: list[str], column: int = 20) -> None:
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names):
        picture = np.full(SIZE[::-1], 40, np.uint8)
        cv2.circle(picture, (column + 40 * number, 100), 10, 240, cv2.FILLED)
        cv2.imwrite(str(folder / name), picture)


@pytest.mark.parametrize("unit", [1, 1000])  # microseconds, nanoseconds
def test_frames_are_cut_around_the_ball(tmp_path: Path, unit: int) -> None:
    disc_pictures(tmp_path, [f"{(98_000 + 2500 * number) * unit}.png" for number in range(8)])
    read = FrameFolder.read(tmp_path)
    assert read.rate_hz == pytest.approx(400.0) and read.size_px == SIZE
    # The first ball lies too near the border, and the last.
    assert [frame.t_s for frame in read.frames] == pytest.approx([0.0025 * number for number in range(1, 7)])
    for number, frame in enumerate(read.frames, start=1):
        y, x = np.nonzero(frame.image > 0.5)
        assert (x.mean() + frame.x0_px, y.mean() + frame.y0_px) == pytest.approx((20 + 40 * number, 100), abs=0.1)
        assert frame.background == pytest.approx(40 / 240)


def video(folder: Path, rate_hz: float) -> Path:
    """Eight pictures of a disc, as a video in the folder."""
    disc_pictures(folder, [f"{number}.png" for number in range(8)])
    path = folder / "flight.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, SIZE)
    for number in range(8):
        picture = cv2.imread(str(folder / f"{number}.png"))
        assert picture is not None
        writer.write(picture)
        (folder / f"{number}.png").unlink()
    writer.release()
    return path


def test_a_video_has_the_frames_of_its_pictures(tmp_path: Path) -> None:
    video(tmp_path, 400.0)
    read = FrameFolder.read(tmp_path)
    assert read.rate_hz == pytest.approx(400.0) and read.size_px == SIZE
    assert [frame.t_s for frame in read.frames] == pytest.approx([0.0025 * number for number in range(1, 7)])
    y, x = np.nonzero(read.frames[2].image > 0.5)
    assert (x.mean() + read.frames[2].x0_px, y.mean() + read.frames[2].y0_px) == pytest.approx((140, 100), abs=0.2)
    (tmp_path / "times.csv").write_text("t_us\n" + "\n".join(str(5000 + 1000 * number) for number in range(8)))
    assert FrameFolder.read(tmp_path).rate_hz == pytest.approx(1000.0)


def test_a_video_without_times_is_refused_in_words(tmp_path: Path) -> None:
    path = video(tmp_path, 30.0)
    with pytest.raises(RecordingError, match=r"states 30 frames a second, which is that of a playback; put times\.csv"):
        FrameFolder.read(tmp_path)
    for text, words in [("t_us\n1\n2", "2 times are stated of the 8 pictures"), ("t_s\n1", "a column t_us")]:
        (tmp_path / "times.csv").write_text(text)
        with pytest.raises(RecordingError, match=words):
            FrameFolder.read(tmp_path)
    (tmp_path / "times.csv").write_text("t_us\n" + "\n".join("11111111"))
    with pytest.raises(RecordingError, match="grow from row to row"):
        FrameFolder.read(tmp_path)
    path.write_bytes(b"RIFF" + bytes(100))
    with pytest.raises(RecordingError, match="no video, or a damaged one"):
        FrameFolder.read(tmp_path)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["a.png"] + [f"{number}.png" for number in range(8)], "a.png is not"),
        (["1000.png", "2000.png"], "2 pictures of a flight are too few"),
        (["1.png", "01.png", "001.png", "0001.png", "00001.png"], "the same time"),
    ],
)
def test_folders_without_frames_are_refused_in_words(tmp_path: Path, names: list[str], words: str) -> None:
    disc_pictures(tmp_path, names)
    with pytest.raises(RecordingError, match=words):
        FrameFolder.read(tmp_path)


def test_a_damaged_picture_and_an_absent_calibration_are_named(tmp_path: Path) -> None:
    disc_pictures(tmp_path, [f"{1000 * number}.png" for number in range(6)])
    (tmp_path / "3000.png").write_bytes(b"PNG")
    with pytest.raises(RecordingError, match=r"no picture, or a damaged one: .*3000\.png"):
        FrameFolder.read(tmp_path)
    with pytest.raises(RecordingError, match=r"calibrate stereo` writes stereo\.toml"):
        frame_camera_beside(tmp_path / "stereo.toml", SIZE)
    (tmp_path / "stereo.toml").write_text("[stereo]\nrotation = 3\n")
    with pytest.raises(RecordingError, match="no file of `spinscope calibrate stereo`"):
        frame_camera_beside(tmp_path / "stereo.toml", SIZE)


@pytest.mark.slow
def test_both_cameras_on_the_same_flight(tmp_path: Path) -> None:
    scene, rival = thrown(20, 4, side=False, seed=76_020), FrameCamera()
    made = render(TaskContext(), scene, seed=76_020)
    write_recording(tmp_path / "shot.raw", made.events, width_px=made.width_px, height_px=made.height_px)
    spin = made.truth.spin_rps[len(made.truth.t_us) // 2]
    (tmp_path / "shot.toml").write_text(tomli_w.dumps({"truth": {"spin_rps": spin.tolist()}}))
    folder = tmp_path / "shot.frames"
    folder.mkdir()
    backdrop = intensity_map(scene, rival.camera).reshape(rival.camera.height_px, rival.camera.width_px)
    for frame in frames(scene, rival, 76_020):
        picture = backdrop.copy()
        rows, columns = (slice(begin, begin + len(frame.image)) for begin in (frame.y0_px, frame.x0_px))
        picture[rows, columns] = frame.image
        cv2.imwrite(str(folder / f"{round(1e6 * frame.t_s)}.png"), np.rint(255 * picture).astype(np.uint8))
    missing = evaluate_real("frames", tmp_path, TaskContext())
    assert "the frame camera is not calibrated" in str(missing.tables[0].rows[-1])
    focal_mm = rival.camera.focal_px * 4.86 / 1000
    tables = {"stereo": {"rotation": np.eye(3).tolist()}, "frame_camera": {"focal_length_mm": focal_mm}}
    (tmp_path / STEREO).write_text(tomli_w.dumps(tables))
    found = evaluate_real("frames", tmp_path, TaskContext())
    (rival_row,), (best,) = (where(found.rows, method=method) for method in (FRAME, "best"))
    for row in (rival_row, best):
        assert float(str(row["magnitude_error_rps"])) < 0.3 and float(str(row["axis_error_deg"])) < 3.0
