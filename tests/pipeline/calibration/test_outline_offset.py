"""Offset of the outline by shots at known distances: found beside a lens farther than measured, its error honest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.calibration.outline_offset import MeasuredOutline, outline_offset
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.simulator import Lens, Scene, SimulatedRecording, simulate_scene
from spinscope.pipeline.simulator.scene import Background, Ball, Flight
from spinscope.pipeline.stages.track_rim import RIM_SHARE, USUAL_BEHIND_PX
from tests.track_runs import HEIGHT, WIDTH, disc_events, merged

CAMERA = Camera.of(CameraParameters(), WIDTH, HEIGHT)
RADIUS_M, OUTLINE_PX = 0.02, 0.7
RADIUS_ONLY = np.array([0.0, 0.0, 0.0, 0.0, 1.0])  # of a ring


def outlines(
    seed: int, distances_m: tuple[float, ...], *, farther_m: float = 0.012, scatter_m: float = 0.01
) -> list[MeasuredOutline]:
    """Shots that pass the image's middle, seen OUTLINE_PX outside by a lens that is farther than measured."""
    random = np.random.default_rng(seed)
    seen = []
    for distance_m in distances_m:
        sight = np.array([*random.uniform(-0.05, 0.05, 2), 1.0])
        away_m = distance_m + farther_m + scatter_m * random.standard_normal()
        x, y, radius = (float(one[0]) for one in CAMERA.silhouette(sight / np.linalg.norm(sight) * away_m, RADIUS_M))
        off_px = OUTLINE_PX + 0.1 * random.standard_normal()
        seen.append(MeasuredOutline(x, y, radius + off_px, distance_m))
    return seen


def test_offset_and_place_of_the_lens_are_found_exactly_without_scatter() -> None:
    exact = outlines(78_100, (0.8, 1.5, 3.0), scatter_m=0.0)
    plain = [MeasuredOutline(one.x_px, one.y_px, 0.0, one.distance_m) for one in exact]
    for number, one in enumerate(plain):
        (ray,) = CAMERA.rays(one.x_px, one.y_px)
        away = ray / np.linalg.norm(ray) * (one.distance_m + 0.005)
        radius = float(CAMERA.silhouette(away, RADIUS_M)[2][0]) + OUTLINE_PX
        plain[number] = MeasuredOutline(one.x_px, one.y_px, radius, one.distance_m)
    found = outline_offset(plain, RADIUS_M, CAMERA)
    assert found.offset_px == pytest.approx(OUTLINE_PX, abs=0.01) and found.farther_m == pytest.approx(5e-3, abs=1e-3)


def test_stated_error_holds() -> None:
    sigmas = []
    for seed in range(78_110, 78_160):
        found = outline_offset(outlines(seed, (1.5,) * 5 + (3.0,) * 5), RADIUS_M, CAMERA)
        assert found.std_px < 0.15
        sigmas.append((found.offset_px - OUTLINE_PX) / found.std_px)
    assert 0.6 < np.sqrt(np.mean(np.square(sigmas))) < 1.4


@pytest.mark.parametrize(
    ("distances_m", "words"), [((1.5, 1.6), "two distances or more"), ((0.5, 0.8), "to .* px only"), ((), "distances")]
)
def test_what_tells_no_offset_is_refused_in_words(distances_m: tuple[float, ...], words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        outline_offset(outlines(78_170, distances_m), RADIUS_M, CAMERA)


def calibrated(tmp_path: Path, recordings: dict[float, tuple[EventBatch, int, int]]) -> Parameters:
    """What the command writes for recordings (events, width, height) at these distances."""
    camera = tmp_path / "camera.toml"
    camera.write_text("[camera]\nfocal_length_mm = 8.02\n[track]\noutline_px = 1.5\n")
    arguments = ["calibrate", "latency", "--camera", str(camera), "--out", str(tmp_path / "out.toml")]
    for distance_m, (events, width_px, height_px) in recordings.items():
        path = tmp_path / f"{distance_m}.raw"
        write_recording(path, events, width_px=width_px, height_px=height_px)
        arguments += [str(path), "--distance-m", str(distance_m)]
    short = CliRunner().invoke(cli, arguments[:-2])
    assert short.exit_code == 2 and "once for each FILE" in short.output
    both = CliRunner().invoke(cli, [*arguments, "--disc", "1", "2", "3"])
    assert both.exit_code == 2 and "give --disc of a turning disc, or --distance-m" in both.output
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert "larger than the ball (2 shots)" in done.output
    return preset(tmp_path / "out.toml")


@pytest.mark.parametrize("behind_px", [USUAL_BEHIND_PX, USUAL_BEHIND_PX - 1.0])
def test_command_counts_what_the_events_behind_tell_once(tmp_path: Path, behind_px: float) -> None:
    """Those behind that lie further in move the rim, and what is written is what that leaves; the camera stays."""
    focal_px = 8020 / 4.86
    recordings = {}
    for distance_m in (1.2, 2.4):
        ring = np.array([500.0, 359.5, 3.5 * focal_px / distance_m, 0.0, RADIUS_M / distance_m * focal_px + OUTLINE_PX])
        ahead, behind = (disc_events(ring + off_px * RADIUS_ONLY, 0, 60_000) for off_px in (0.0, behind_px))
        recordings[distance_m] = merged(ahead[ahead.on], behind[~behind.on]), WIDTH, HEIGHT
    written = calibrated(tmp_path, recordings)
    expected_px = OUTLINE_PX + RIM_SHARE * (behind_px - USUAL_BEHIND_PX)
    assert written.track.outline_px == pytest.approx(expected_px, abs=0.2) and written.camera.focal_length_mm == 8.02


def test_a_soft_lens_that_was_calibrated_tells_the_radius(tmp_path: Path) -> None:
    """Of flights at another distance, too, where the circle of the events ahead is 2 px larger."""

    def flown(distance_m: float, seed: int) -> SimulatedRecording:
        flight = Flight(0.0, 0.03, (-0.09, 0.0, distance_m), (6.0, 0.5, 0.0), (0.0, 40.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        ground = Background(kind="plain", albedo=0.12, height_m=distance_m + 0.25)
        scene, lens = Scene(0.03, (Ball((flight,)),), background=ground), Lens(blur_px=1.2, focus_m=distance_m)
        return simulate_scene(scene, camera=camera, lens=lens, seed=seed)

    camera = Camera.of(CameraParameters(focal_length_mm=8.02), 320, 240)
    shots = {distance_m: flown(distance_m, 91_060) for distance_m in (1.5, 2.5)}
    written = calibrated(tmp_path, {distance_m: (one.events, 320, 240) for distance_m, one in shots.items()})
    other = flown(2.0, 91_061)
    chain = Chain(EventsInMemory("other", other.events, 320, 240, 0, other.duration_us))
    *_, last = (tick.track.ball for tick in chain.run(written, targets=("track",)))
    assert last is not None, "the ball is tracked"
    assert last.mean[4] == pytest.approx(np.interp(last.t_us, other.truth.t_us, other.truth.radius_px), abs=0.15)
