"""Offset of the outline by shots at known distances: found beside a lens farther than measured, its error honest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.calibration.outline_offset import MeasuredOutline, outline_offset
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recordings import write_recording
from tests.track_runs import HEIGHT, WIDTH, disc_events

CAMERA = Camera.of(CameraParameters(), WIDTH, HEIGHT)
RADIUS_M, OUTLINE_PX = 0.02, 0.7


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
    assert found.outline_px == pytest.approx(OUTLINE_PX, abs=0.01) and found.farther_m == pytest.approx(5e-3, abs=1e-3)


def test_stated_error_holds() -> None:
    sigmas = []
    for seed in range(78_110, 78_160):
        found = outline_offset(outlines(seed, (1.5,) * 5 + (3.0,) * 5), RADIUS_M, CAMERA)
        assert found.std_px < 0.15
        sigmas.append((found.outline_px - OUTLINE_PX) / found.std_px)
    assert 0.6 < np.sqrt(np.mean(np.square(sigmas))) < 1.4


@pytest.mark.parametrize(
    ("distances_m", "words"), [((1.5, 1.6), "two distances or more"), ((0.5, 0.8), "to .* px only"), ((), "distances")]
)
def test_what_tells_no_offset_is_refused_in_words(distances_m: tuple[float, ...], words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        outline_offset(outlines(78_170, distances_m), RADIUS_M, CAMERA)


def test_command_writes_it_beside_the_camera(tmp_path: Path) -> None:
    camera = tmp_path / "camera.toml"
    camera.write_text("[camera]\nfocal_length_mm = 8.02\n")
    focal_px = 8020 / 4.86
    arguments = ["calibrate", "latency", "--camera", str(camera), "--out", str(tmp_path / "out.toml")]
    for distance_m in (1.2, 2.4):
        radius_px = RADIUS_M / distance_m * focal_px + OUTLINE_PX
        ring = np.array([500.0, 359.5, 3.5 * focal_px / distance_m, 0.0, radius_px])
        path = tmp_path / f"{distance_m}.raw"
        write_recording(path, disc_events(ring, 0, 60_000), width_px=WIDTH, height_px=HEIGHT)
        arguments += [str(path), "--distance-m", str(distance_m)]
    short = CliRunner().invoke(cli, arguments[:-2])
    assert short.exit_code == 2 and "once for each FILE" in short.output
    both = CliRunner().invoke(cli, [*arguments, "--disc", "1", "2", "3"])
    assert both.exit_code == 2 and "give --disc of a turning disc, or --distance-m" in both.output
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    written = preset(tmp_path / "out.toml")
    assert written.track.outline_px == pytest.approx(OUTLINE_PX, abs=0.2) and written.camera.focal_length_mm == 8.02
