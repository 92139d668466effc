"""Small recordings after kinds of trouble that users report, all of one spinner's 9,917 events."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording

FOLDER = Path(os.environ.get("SPINSCOPE_REAL_RECORDINGS", "")) / "trouble"
pytestmark = pytest.mark.skipif(
    "SPINSCOPE_REAL_RECORDINGS" not in os.environ, reason="SPINSCOPE_REAL_RECORDINGS names no folder of recordings"
)

READ = {
    "01_event_utils_xs_ys_ts_ps.h5": {},
    "02_v2e_events_Nx4.h5": {},
    "04_m3ed_prophesee_left.h5": {"dataset": "prophesee/left"},
    "05_mvsec_davis_left_events.h5": {"dataset": "davis/left"},
    "06_times_ns_int.npz": {"time_unit": "ns"},
    "06c_times_ms_float.npz": {"time_unit": "ms"},
    "07b_userblock512.h5": {},
    "07c_columns_Nx1.h5": {},
    "09_npz_events_Nx4.npz": {},
    "20_evt3_plain.raw": {},
    "22b_dat_header_date_first.dat": {},
}


@pytest.mark.parametrize("name", READ)
def test_layouts_in_use_are_read(name: str) -> None:
    events = open_recording(FOLDER / name, **READ[name]).read()
    plain = open_recording(FOLDER / "20_evt3_plain.raw").read()
    assert len(events) == 9917 and np.array_equal(events.t_us - events.t_us[0], plain.t_us - 31)
    for column in ("x_px", "y_px", "on"):
        assert getattr(events, column).sum() == getattr(plain, column).sum(), column


@pytest.mark.parametrize("name", ["03_one_event_y33014.h5", "03b_one_event_y33014_geometry.h5"])
def test_one_broken_coordinate_costs_one_event(name: str) -> None:
    recording = open_recording(FOLDER / name)
    assert len(recording.read()) == 9916
    assert recording.damage.outside_events == 1


@pytest.mark.parametrize(("name", "unit"), [("06_times_ns_int.npz", "ns"), ("06c_times_ms_float.npz", "ms")])
def test_an_implausible_rate_is_warned_of_with_its_remedy(name: str, unit: str) -> None:
    assert any(f"--time-unit {unit}" in warning for warning in open_recording(FOLDER / name).warnings)


def test_events_before_the_clock_starts_are_dropped_and_said() -> None:
    recording = open_recording(FOLDER / "21b_evt2_stale_start_5s.raw")
    events = recording.read()
    assert (len(events), int(events.t_us[0]), int(events.t_us[-1])) == (9917, 31, 99_937)
    assert recording.damage.stale_events == 60 and "60 events of an earlier time" in " ".join(recording.warnings)


def test_both_halves_around_a_clock_reset_are_kept() -> None:
    recording = open_recording(FOLDER / "23_evt3_clock_reset_mid.raw")
    events = recording.read()
    plain = open_recording(FOLDER / "20_evt3_plain.raw").read()
    assert np.array_equal(events.x_px, plain.x_px) and np.array_equal(events.y_px, plain.y_px)
    assert recording.damage.clock_resets == 1 and "set back 1 times" in " ".join(recording.warnings)


def test_a_text_cut_in_its_last_line_is_read_up_to_it() -> None:
    recording = open_recording(FOLDER / "08b_events.txt")
    assert len(recording.read()) == 6820 and recording.sensor_from == "file"
    assert recording.damage.broken_events == 1


def test_a_dataset_without_events_is_refused_with_those_that_hold_some() -> None:
    with pytest.raises(RecordingError, match="give one of prophesee/left"):
        open_recording(FOLDER / "04_m3ed_prophesee_left.h5", dataset="ovc/left")
