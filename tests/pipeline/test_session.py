"""Sessions: presets, attributes and choices become parameters, in the right order of strength."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import pytest

from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.presets import preset
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Choices, Session


def test_the_default_preset_is_the_declared_defaults() -> None:
    assert preset("default") == Parameters()


def test_the_papers_preset_names_its_filter() -> None:
    paper = preset("paper")
    assert (paper.filter.mode, paper.filter.threshold_us) == ("stc_cut_trail", 5000)
    assert (paper.surface.kind, paper.surface.k_px) == ("eros", 10)
    assert paper.spin.triplet_solve == "paper"


def test_assignments_beat_the_preset(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[logo]\npad_px = 4.0\n[track]\ntick_us = 1000\n", encoding="utf-8")
    parameters = Choices(preset=str(file), assignments=("logo.pad_px=1",)).parameters()
    assert (parameters.logo.pad_px, parameters.track.tick_us) == (1.0, 1000)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[logo\n", "cannot be read"),
        ("[logo]\npad = 3\n", "did you mean pad_px"),
        ("logo = 3\n", "not a table"),
        ("[logo]\npad_px = 'wide'\n", "not a number"),
    ],
)
def test_malformed_presets_are_refused(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=says):
        preset(file)


def test_an_unknown_preset_names_the_known_ones() -> None:
    with pytest.raises(ParameterError, match="default, paper"):
        preset("papr")


def test_the_recordings_camera_is_taken_unless_the_user_says_otherwise(samples: Path, tmp_path: Path) -> None:
    file = tmp_path / "lens.h5"
    shutil.copy(samples / "spinner_ball1_top.h5", file)
    with h5py.File(file, "r+") as recording:
        recording.attrs["camera.focal_length_mm"] = 12.0
    assert Session.open(file, Choices()).parameters.camera.focal_length_mm == 12.0
    chosen = Choices(assignments=("camera.focal_length_mm=8",))
    assert Session.open(file, chosen).parameters.camera.focal_length_mm == 8.0


def test_a_window_is_half_open_in_file_time(samples: Path) -> None:
    session = Session.open(samples / "flight_back.h5", Choices(window_us=(20_000, 30_000)))
    assert session.source.events.t_us[0] >= 20_000
    assert session.source.events.t_us[-1] < 30_000
    ticks = list(session.ticks())
    assert (ticks[0].packet.start_us, ticks[-1].packet.end_us) == (20_000, 30_000)


def test_an_empty_window_says_so(samples: Path) -> None:
    with pytest.raises(RecordingError, match="no events from 900000000 to 900000001"):
        Session.open(samples / "flight_back.h5", Choices(window_us=(900_000_000, 900_000_001)))


def test_without_a_window_every_event_is_in_a_tick(samples: Path) -> None:
    """From the first event's time to just after the last one's."""
    session = Session.open(samples / "flight_back.h5")
    t_us = session.source.events.t_us
    assert (session.source.start_us, session.source.end_us) == (t_us[0], t_us[-1] + 1)
    ticks = session.ticks(("filter",))
    assert sum(len(tick.packet.events) for tick in ticks) == len(t_us)


def test_windows_and_clips_of_one_recording_are_different_sources(samples: Path) -> None:
    path = samples / "flight_back.h5"
    windows = [None, (20_000, 30_000), (20_000, 40_000)]
    sessions = [Session.open(path, Choices(window_us=window)) for window in windows]
    clip = sessions[0].clip(20_000, 30_000)
    identities = [session.source.identity for session in sessions]
    assert len(set(identities)) == 3
    assert clip.source.identity == identities[1], "the same events"
    assert clip.chain is not sessions[0].chain and clip.chain.source is clip.source
    assert len(clip.source.events) == len(sessions[1].source.events)


def test_the_report_names_what_was_read(samples: Path) -> None:
    session = Session.open(
        samples / "flight_back.h5", Choices(window_us=(20_000, 31_000), assignments=("logo.pad_px=3",))
    )
    report = session.estimate("triplet").to_dict()
    assert report["recording"] == {
        "path": str(samples / "flight_back.h5"), "events": len(session.source.events), "duration_us": 11_000,
        "width": 1280, "height": 720,
    }  # fmt: skip
    assert report["parameters"]["logo"]["pad_px"] == 3.0
    seconds = report["seconds"]
    assert seconds["read"] == session.read_seconds > 0
    assert seconds["track"] > 0 and seconds["spin"] > 0
    assert seconds["total"] == pytest.approx(seconds["read"] + seconds["track"] + seconds["spin"])


def test_a_method_that_does_not_exist_is_refused_by_name(samples: Path) -> None:
    with pytest.raises(ParameterError, match="'magic'"):
        Session.open(samples / "flight_back.h5", Choices(window_us=(20_000, 30_000))).estimate("magic")
