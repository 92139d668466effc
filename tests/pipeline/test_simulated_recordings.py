"""Simulated recordings: what is written, and what is refused."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

import spinscope
from spinscope.pipeline.biases import PAPER, BiasParameters
from spinscope.pipeline.errors import ParameterError, RecordingError, SpinscopeError
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.simulated_recordings import (
    BIASES,
    DESCRIPTION,
    simulate_again_to_file,
    simulate_to_file,
    write_simulation,
)

SENSITIVE = BiasParameters(diff_on=0, diff_off=0)  # lower thresholds: more events
SMALL: dict[str, Any] = {"width_px": 240, "height_px": 160, "seed": 5}


def test_same_seed_and_options_same_events(tmp_path: Path) -> None:
    one, two, other = (tmp_path / name for name in ("one.h5", "two.h5", "other.h5"))
    simulate_to_file("flight", one, spin="mixed", **SMALL)
    simulate_to_file("flight", two, spin="mixed", **SMALL)
    simulate_to_file("flight", other, spin="mixed", **(SMALL | {"seed": 6}))
    assert one.read_bytes() == two.read_bytes()
    assert open_recording(one).read().t_us.tobytes() != open_recording(other).read().t_us.tobytes()


def test_a_script_simulates_estimates_and_writes(tmp_path: Path) -> None:
    made = spinscope.simulate("flight", spin_rps=(40, 0, -10), seed=7, width_px=320, height_px=240, focal_length_mm=6.0)
    assert made.scene.balls[0].motions[0].spin_rps == (40.0, 0.0, -10.0)
    np.testing.assert_array_equal(made.truth.spin_rps[0], (40.0, 0.0, -10.0))
    assert made.truth.label.size == len(made.events) > 1000
    result = spinscope.estimate(made)
    assert result.session.parameters.camera.focal_length_mm == 6.0
    written = write_simulation(made, tmp_path / "flight.h5")
    assert written.recording is made
    of_file = spinscope.estimate(tmp_path / "flight.h5")
    assert len(result.shots) == len(of_file.shots) == 1
    np.testing.assert_array_equal(result.shots[0].state, of_file.shots[0].state)


def test_a_larger_ball_is_larger_in_the_image(tmp_path: Path) -> None:
    radius_px = []
    for radius_mm in (20.0, 22.0):
        out = tmp_path / f"{radius_mm}.h5"
        simulate_to_file("spinner", out, radius_mm=radius_mm, duration_ms=5.0, **SMALL)
        truth = open_recording(out).truth
        assert truth is not None
        radius_px.append(truth.radius_px[0])
    assert radius_px[1] == pytest.approx(1.1 * radius_px[0], rel=1e-3)


def test_spinner_has_the_spin_asked_for(tmp_path: Path) -> None:
    seen: list[float] = []
    written = simulate_to_file(
        "spinner",
        tmp_path / "spinner.h5",
        spin_rps=(10.0, -20.0, 30.0),
        duration_ms=20.0,
        on_progress=lambda share, what: seen.append(share),
        **SMALL,
    )
    truth = open_recording(written.path).truth
    assert truth is not None
    np.testing.assert_allclose(truth.spin_rps, np.tile([10.0, -20.0, 30.0], (truth.t_us.size, 1)))
    made = written.recording
    assert made.duration_us == 20_000 and len(made.events) == truth.label.size
    assert made.logo_events == np.count_nonzero(truth.label == 2)
    assert seen == sorted(seen) and seen[-1] == 1.0


def test_scene_again_with_other_biases(tmp_path: Path) -> None:
    first, again, sensitive = (tmp_path / name for name in ("first.h5", "again.h5", "sensitive.h5"))
    simulate_to_file("spinner", first, duration_ms=10.0, **SMALL)
    simulate_again_to_file(first, again)
    simulate_again_to_file(first, sensitive, biases=SENSITIVE)
    assert first.read_bytes() == again.read_bytes()
    one, other = open_recording(first), open_recording(sensitive)
    assert one.truth is not None and other.truth is not None
    np.testing.assert_array_equal(one.truth.position_m, other.truth.position_m)
    assert len(other.read()) > len(one.read())
    assert json.loads(str(one.attributes[BIASES])) == PAPER.as_dict()
    assert json.loads(str(other.attributes[BIASES])) == SENSITIVE.as_dict()


def test_picture_as_logo_travels_with_the_recording(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (300, 300), np.uint8)  # cannot be compressed: 90 kB
    cv2.imwrite(str(tmp_path / "logo.png"), noise)
    out = tmp_path / "ball.h5"
    written = simulate_to_file("spinner", out, logo=str(tmp_path / "logo.png"), duration_ms=10.0, **SMALL)
    assert written.recording.logo_events > 0
    (tmp_path / "logo.png").unlink()
    again = simulate_again_to_file(out, tmp_path / "again.h5")
    assert len(again.recording.events) == len(written.recording.events)
    assert len(str(open_recording(out).attributes[DESCRIPTION])) > 90_000


@pytest.mark.parametrize("suffix", [".raw", ".npz"])
def test_formats_without_truth_say_so(tmp_path: Path, suffix: str) -> None:
    whole = simulate_to_file("spinner", tmp_path / "ball.h5", duration_ms=10.0, **SMALL)
    bare = simulate_to_file("spinner", tmp_path / f"ball{suffix}", duration_ms=10.0, **SMALL)
    assert not whole.warnings and "no truth" in bare.warnings[0]
    one, other = open_recording(whole.path).read(), open_recording(bare.path).read()
    for column in ("t_us", "x_px", "y_px", "on"):
        np.testing.assert_array_equal(getattr(one, column), getattr(other, column))


def test_rally_has_its_shots(tmp_path: Path) -> None:
    out = tmp_path / "rally.h5"
    written = simulate_to_file("rally", out, shots=2, duration_ms=700.0, speed_m_s=8.0, **SMALL)
    truth = open_recording(written.path).truth
    assert truth is not None
    assert np.count_nonzero(np.diff(truth.t_us) > 500) == 1  # one pause between two shots


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("serve", {}, "spinner, flight, rally"),
        ("flight", {"logo": "nobody"}, "logo 'nobody' is unknown"),
        ("flight", {"logo": "missing.png"}, "logo cannot be read"),
        ("flight", {"speed_m_s": -3.0}, "speed_m_s = -3 is out of range: 0.5 to 50 m/s"),
        ("flight", {"radius_mm": -20.0}, "radius_mm = -20 is out of range: 1 to 500 mm"),
        ("flight", {"magnitude_rps": -1.0}, "magnitude_rps = -1 is out of range"),
        ("flight", {"spin_rps": (0.0, 0.0, 4000.0)}, "the simulator's time step allows 1000 rps"),
        ("flight", {"spin_rps": (0.0, float("nan"), 0.0)}, "out of range"),
        ("flight", {"speed": 3.0}, "did you mean"),
        ("flight", {"seed": -1}, "seed = -1 is out of range"),
        ("spinner", {"ball": 8}, "ball = 8 is out of range"),
        ("spinner", {"speed_m_s": 5.0}, "speed_m_s does not belong to a spinner"),
        ("spinner", {"spin": "left"}, "top, back, side"),
        ("spinner", {"duration_ms": 0.0}, "duration_ms = 0 is out of range"),
        ("rally", {"spin_rps": (1.0, 0.0, 0.0)}, "does not belong to a rally"),
        ("rally", {"shots": 50, "duration_ms": 1000.0}, "do not fit"),
    ],
)
def test_nonsense_gets_one_line_and_no_file(tmp_path: Path, kind: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises(SpinscopeError, match=words) as caught:
        simulate_to_file(kind, tmp_path / "out.h5", **(SMALL | options))
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "folder.h5").mkdir()
    for name in ("no/such/folder.h5", "folder.h5", "suffix.mp4"):
        with pytest.raises(RecordingError, match="give another"):
            simulate_to_file("spinner", tmp_path / name, **SMALL)


@contextmanager
def little_room(size: int) -> Iterator[None]:
    """As on a disk that is full after so many bytes of one file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("suffix", [".h5", ".raw", ".npz"])
def test_a_full_disk_gets_one_line_and_no_half_file(tmp_path: Path, suffix: str) -> None:
    simulate_to_file("spinner", tmp_path / "room.h5", duration_ms=5.0, **SMALL)  # kernels and plugins are loaded
    (tmp_path / "room.h5").unlink()
    with little_room(4096), pytest.raises(RecordingError, match=r"cannot be written.*free space") as caught:
        simulate_to_file("spinner", tmp_path / f"ball{suffix}", duration_ms=200.0, **SMALL)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_interruption_leaves_nothing(tmp_path: Path) -> None:
    def stop(share: float, what: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_to_file("spinner", tmp_path / "ball.h5", on_progress=stop, **SMALL)
    assert not list(tmp_path.iterdir())


def test_only_simulated_recordings_can_be_simulated_again(tmp_path: Path, samples: Path) -> None:
    with pytest.raises(RecordingError, match="holds no scene"):
        simulate_again_to_file(samples / "flight_back.h5", tmp_path / "again.h5")
    made = simulate_to_file("spinner", tmp_path / "ball.h5", duration_ms=5.0, **SMALL)
    with h5py.File(made.path, "a") as file:
        file.attrs[DESCRIPTION] = '{"scene": 3}'
    with pytest.raises(ParameterError, match="this is no"):
        simulate_again_to_file(made.path, tmp_path / "again.h5")
