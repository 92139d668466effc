"""Real recordings against counts and sums that two or more independent decoders agree on."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording

FOLDER = Path(os.environ.get("SPINSCOPE_REAL_RECORDINGS", ""))
pytestmark = pytest.mark.skipif(
    "SPINSCOPE_REAL_RECORDINGS" not in os.environ, reason="SPINSCOPE_REAL_RECORDINGS names no folder of recordings"
)

# Format, size of the sensor; number of events, first and last time, sums of x, y and p; number of triggers.
GEN31 = (640, 480), (343474, 7139845, 9218023, 116731888, 80879209, 125183), 4157
EVK = (1280, 720), (82469, 14224870, 15476187, 42078718, 31656267, 41439), 2
GOLDEN = {
    "gen31_cable_4157triggers_evt3.raw": ("EVT3 RAW", *GEN31),
    "evk_1280x720_2triggers_evt3.raw": ("EVT3 RAW", *EVK),
    "test_events_1.bag": ("ROS1 bag", *GEN31),
    "test_data_evt3_trigger_0.db3": ("ROS2 bag (SQLite)", *EVK),
    "davis346.aedat4": (
        "AEDAT4",
        (346, 260),
        (78830, 1589163147368868, 1589163149728813, 14861513, 15061593, 41257),
        236,
    ),
    "davis.aedat4": (
        "AEDAT4",
        (346, 260),
        (117667, 1633953690975950, 1633953691105949, 17676033, 10498046, 72363),
        15,
    ),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_counts_and_sums_are_those_of_other_decoders(name: str) -> None:
    format, size, sums, triggers = GOLDEN[name]
    recording = open_recording(FOLDER / name)
    events = recording.read()
    columns = (events.x_px, events.y_px, events.on)
    found = (len(events), int(events.t_us[0]), int(events.t_us[-1]), *(int(column.sum()) for column in columns))
    assert (recording.format, (recording.width_px, recording.height_px), found) == (format, size, sums)
    assert len(recording.triggers) == triggers and not recording.damage.sentences()


@pytest.mark.parametrize(("name", "count"), [("davis346.aedat4", 59), ("davis.aedat4", 3)])
def test_pictures_of_the_camera_are_read(name: str, count: int) -> None:
    recording = open_recording(FOLDER / name)
    frames = list(recording.frames(-(2**63), 2**63 - 1))
    assert len(frames) == count and {frame.pixels.shape for frame in frames} == {(260, 346)}
    first_us, last_us = frames[0].t_us, frames[-1].t_us
    assert len(list(recording.frames(first_us + 1, last_us))) == count - 2
    assert all(10 < frame.pixels.mean() < 245 for frame in frames)


# Events of `simulated/`, as its README states them.
SIMULATED = {
    "spinner_ball1_top": 6603,
    "spinner_ball2_side": 9917,
    "spinner_ball3_back": 4668,
    "spinner_ball5_back_no_logo": 3366,
    "flight_slow_top": 155_824,
    "flight_back": 124_029,
    "flight_fast_top": 125_061,
    "flight_side": 157_288,
    "flight_mixed": 121_946,
    "flight_two_balls": 176_271,
}


@pytest.mark.parametrize("name", SIMULATED)
def test_simulated_recordings_have_their_events_with_a_label_each(name: str) -> None:
    recording = open_recording(FOLDER / "simulated" / f"{name}.h5")
    assert len(recording.read()) == recording.events == SIMULATED[name]
    assert recording.truth is not None and recording.truth.label.size == SIMULATED[name]


def test_a_bag_that_is_cut_is_refused_in_one_line(tmp_path: Path) -> None:
    whole = (FOLDER / "test_events_1.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RecordingError, match=r"ROS1 bag file is damaged or was cut"):
        open_recording(tmp_path / "cut.bag")


def test_a_cut_aedat4_file_is_read_up_to_the_cut(tmp_path: Path) -> None:
    whole = (FOLDER / "davis.aedat4").read_bytes()
    (tmp_path / "cut.aedat4").write_bytes(whole[: len(whole) // 2])
    recording, all_events = open_recording(tmp_path / "cut.aedat4"), open_recording(FOLDER / "davis.aedat4").read()
    events = recording.read()
    assert 0.2 * len(all_events) < len(events) < 0.8 * len(all_events)
    assert (events.x_px == all_events.x_px[: len(events)]).all()
    assert recording.damage.broken_ends == 1
