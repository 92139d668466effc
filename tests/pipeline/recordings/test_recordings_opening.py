"""What can be wrong before the first event: paths, formats, rights."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording, write_recording
from spinscope.pipeline.recordings.optional_packages import optional_module
from spinscope.pipeline.recordings.sensor import KNOWN_SENSORS, smallest_known
from tests.pipeline.recordings.test_recordings_raw import assert_same_events, moving_edge

HEADS = {
    "a.aedat4": (b"#!AER-DAT4.0\r\n", "AEDAT4 file is damaged or was cut"),
    "a.aedat": (b"#!AER-DAT2.0\r\n", "AEDAT of version 2 is not read: convert it to AEDAT4"),
    "a.bag": (b"#ROSBAG V2.0\n", "ROS1 bag file is damaged or was cut"),
    "a.db3": (b"SQLite format 3\0", "ROS2 bag (SQLite) file is damaged or was cut"),
    "a.npy": (b"\x93NUMPY\x01\x00", "NPY file is damaged or was cut"),
    "a.h5.gz": (b"\x1f\x8b\x08\x00", "gzip-packed"),
    "a.h5": (b"version https://git-lfs.github.com", "file named .h5 is no HDF5 file"),
    "a.raw": (b"\x00\x01\x02\x03", "file named .raw is no Prophesee RAW file"),
    "a.npz": (b"no zip at all", "file named .npz is no NPZ"),
    "a.txt": (b"1 2 3\n", "file named .txt is no CSV or text file"),
    "b.txt": (b"5 6 7 8\n", "columns of the text cannot be told apart"),
    "b.npz": (b"PK\x03\x04 and no more", "NPZ file is damaged or was cut"),
    "b.h5": (b"\x89HDF\r\n\x1a\n and no more", "HDF5 file is damaged or was cut"),
    "empty.h5": (b"", "is empty"),
}


@pytest.mark.parametrize("name", HEADS)
def test_what_is_no_recording_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(HEADS[name][0])
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    message = str(caught.value)
    assert HEADS[name][1] in message and message.endswith(str(path)) and "\n" not in message


def test_a_package_that_is_not_installed_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(RecordingError, match=r"AEDAT4 files .* not installed \(`pip install spinscope\[aedat\]`"):
        optional_module("no_module_of_this_name", "aedat", "AEDAT4")


def test_missing_files_folders_and_closed_doors_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"does not exist.*gone\.h5$"):
        open_recording(tmp_path / "gone.h5")
    with pytest.raises(RecordingError, match="is a folder, not a file"):
        open_recording(tmp_path)
    (tmp_path / "loop.h5").symlink_to(tmp_path / "loop.h5")
    with pytest.raises(RecordingError, match=r"loop\.h5$"):
        open_recording(tmp_path / "loop.h5")
    os.mkfifo(tmp_path / "pipe.raw")
    with pytest.raises(RecordingError, match="not an ordinary file"):
        open_recording(tmp_path / "pipe.raw")
    with pytest.raises(RecordingError):
        open_recording("a\0b.h5")
    with pytest.raises(RecordingError, match=r"x{300}\.h5$"):
        open_recording(tmp_path / ("x" * 300 + ".h5"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(RecordingError, match="may not be read"):
        open_recording(path)


def test_the_content_decides_not_the_suffix(tmp_path: Path) -> None:
    events = moving_edge(200)
    for kind, name in (("h5", "a.raw"), ("raw", "a.npz"), ("npz", "a")):
        write_recording(tmp_path / f"right.{kind}", events, width_px=1280, height_px=720)
        (tmp_path / f"right.{kind}").rename(tmp_path / name)
    for name, format in (("a.raw", "HDF5 columns"), ("a.npz", "EVT3 RAW"), ("a", "NPZ")):
        recording = open_recording(tmp_path / name)
        assert recording.format == format and recording.sensor_from == "file"
        assert_same_events(recording.read(), events)


def test_identity_is_of_the_content(tmp_path: Path) -> None:
    for name, n in (("a.raw", 100), ("b.raw", 100), ("c.raw", 101)):
        write_recording(tmp_path / name, moving_edge(n), width_px=1280, height_px=720)
    a, b, c = (open_recording(tmp_path / name).identity() for name in ("a.raw", "b.raw", "c.raw"))
    assert a == b != c


@pytest.mark.parametrize("place", [0, 50, 99])
def test_of_large_files_start_middle_and_end_are_told_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    monkeypatch.setattr("spinscope.pipeline.recordings.recording.HASH_ALL_BYTES", 99)
    monkeypatch.setattr("spinscope.pipeline.recordings.recording.HASH_BLOCK_BYTES", 4)
    path, data = tmp_path / "a.raw", bytearray(b"% evt 3.0\n% end\n" + bytes(84))
    path.write_bytes(data)
    before, stamp = open_recording(path).identity(), path.stat().st_mtime_ns
    path.write_bytes(data[:20] + b"\1" + data[21:])
    os.utime(path, ns=(stamp, stamp))
    assert open_recording(path).identity() == before  # what lies between is not looked at
    os.utime(path, ns=(stamp, stamp + 1))
    assert open_recording(path).identity() != before
    recording = open_recording(path)
    data[place] ^= 1
    path.write_bytes(data)
    os.utime(path, ns=(stamp, stamp))
    assert recording.identity() != before


def test_a_sensor_that_is_none_is_refused(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.npz", moving_edge(10), width_px=1280, height_px=720)
    for size in ((0, 720), (1280, -1), (100_000, 10), (8192, 8192)):
        with pytest.raises(RecordingError, match="is not 1 to 8192 pixels"):
            open_recording(tmp_path / "a.npz", sensor=size)


def test_the_guess_is_the_smallest_known_sensor() -> None:
    assert smallest_known(0, 0) == (304, 240)
    assert smallest_known(305, 10) == (320, 320) if 320 * 320 < 346 * 260 else (346, 260)
    assert smallest_known(1280, 720) == (1280, 720)
    assert smallest_known(3000, 1) is None
    assert all(smallest_known(*size) == size for size in KNOWN_SENSORS)


def test_progress_rises_to_one(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.npz", moving_edge(1000), width_px=1280, height_px=720)
    write_recording(tmp_path / "a.raw", moving_edge(1000), width_px=1280, height_px=720)
    write_recording(tmp_path / "a.h5", moving_edge(1000), width_px=1280, height_px=720)
    for kind in ("npz", "raw", "h5"):
        shares: list[float] = []
        for _ in open_recording(tmp_path / f"a.{kind}").chunks(max_events=100, on_progress=shares.append):
            pass
        assert shares == sorted(shares) and shares[-1] == 1.0


def test_an_empty_recording_can_be_read(tmp_path: Path) -> None:
    nothing = moving_edge(0)
    write_recording(tmp_path / "a.npz", nothing, width_px=64, height_px=64)
    write_recording(tmp_path / "a.raw", nothing, width_px=64, height_px=64)
    write_recording(tmp_path / "a.h5", nothing, width_px=64, height_px=64)
    for kind in ("npz", "raw", "h5"):
        recording = open_recording(tmp_path / f"a.{kind}")
        assert len(recording.read()) == 0 and len(recording.read(0, 100)) == 0 and len(recording.triggers) == 0


def test_batches_do_not_change_when_reading_goes_on(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.raw", moving_edge(20_000), width_px=1280, height_px=720)
    batches = list(open_recording(tmp_path / "a.raw").chunks(max_events=700))
    assert_same_events(type(batches[0]).concatenate(batches), moving_edge(20_000))
    assert not any(column.flags.writeable for b in batches for column in (b.t_us, b.x_px, b.y_px, b.on))
    assert np.all([len(b) <= 700 for b in batches])
