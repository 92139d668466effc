"""The surface stage: what it shows at the end of a tick, how it is cleaned, and the same without the JIT."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels import eros
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import filter as filter_stage
from spinscope.pipeline.stages import surface as stage
from spinscope.pipeline.stages.filter import FilterParameters, FilterResult
from spinscope.pipeline.stages.surface import SurfaceParameters, SurfaceResult
from tests.reference.surface import NaiveEros, NaiveTos, cleaned, recent_events

WIDTH, HEIGHT, TICK_US = 45, 31, 1000  # neither is a multiple of a word
CONTEXT = Context(Camera.of(CameraParameters(), WIDTH, HEIGHT), 0.02, {"spin.max_spin_rps": 150.0})
START_US = 1_600_000_000_000_000
ROOT = Path(__file__).parents[3]


def packets(ticks: int = 5, events_a_tick: int = 100) -> list[Packet]:
    """Random events; the third tick has none."""
    rng = np.random.default_rng(8)
    result = []
    for index in range(ticks):
        start_us, count = START_US + index * TICK_US, 0 if index == 2 else events_a_tick
        batch = EventBatch(
            np.sort(rng.integers(start_us, start_us + TICK_US, count)),
            rng.integers(0, WIDTH, count).astype(np.uint16),
            rng.integers(0, HEIGHT, count).astype(np.uint16),
            rng.random(count) < 0.5,
        )
        result.append(Packet(index, start_us, start_us + TICK_US, batch))
    return result


def run(parameters: SurfaceParameters) -> list[SurfaceResult]:
    state = stage.start(parameters, CONTEXT)
    results = []
    for packet in packets():
        filtered, unfiltered = packet.events, dataclasses.replace(packet, events=EventBatch.empty())
        results.append(
            stage.step(parameters, state, unfiltered, FilterResult(filtered, EventBatch.empty(), EventBatch.empty()))
        )
    return results


@pytest.mark.parametrize("k_px", [1, 10, 11, 32, 49])
def test_eros_equals_the_reference_at_every_tick(k_px: int) -> None:
    twin = NaiveEros(WIDTH, HEIGHT, k_px)
    for packet, result in zip(packets(), run(SurfaceParameters(k_px=k_px)), strict=True):
        twin.draw(packet.events.x_px, packet.events.y_px)
        assert np.array_equal(result.values, twin.read())


@pytest.mark.parametrize("k_px", [1, 7, 10, 32, 49])
def test_tos_equals_its_twin_at_every_tick(k_px: int) -> None:
    twin = NaiveTos(WIDTH, HEIGHT, k_px)
    for packet, result in zip(packets(), run(SurfaceParameters(kind="tos", k_px=k_px)), strict=True):
        twin.draw(packet.events.x_px, packet.events.y_px)
        assert np.array_equal(result.values, twin.read())


@pytest.mark.parametrize("kind", ["accumulated", "linear"])
@pytest.mark.parametrize("span_us", [300, 1000, 2500])
def test_the_other_kinds_look_back_across_ticks(kind: str, span_us: int) -> None:
    all_events = EventBatch.concatenate([p.events for p in packets()])
    columns = [c.tolist() for c in (all_events.t_us, all_events.x_px, all_events.y_px)]
    for packet, result in zip(packets(), run(SurfaceParameters(kind=kind, span_us=span_us)), strict=True):
        expected = recent_events(*columns, (HEIGHT, WIDTH), packet.end_us, span_us, kind == "linear")
        assert np.array_equal(result.values, expected)


@pytest.mark.parametrize("kind", stage.KINDS)
def test_results_are_fresh_and_read_only(kind: str) -> None:
    results = run(SurfaceParameters(kind=kind))
    for one, other in itertools.combinations(results, 2):
        assert not np.shares_memory(one.levels, other.levels)
    for result in results:
        assert result.values.dtype == np.uint8
        assert result.values.shape == (HEIGHT, WIDTH)
        assert not result.values.flags.writeable and not result.levels.flags.writeable
        assert result.level_of(128) == np.flatnonzero(result.table >= 128)[0]
        window = result.cleaned(0, 0, WIDTH, HEIGHT)
        assert not np.shares_memory(window, result.levels)


@pytest.mark.parametrize("k_px", [1, 10, 49])
def test_a_surface_without_its_events_is_empty(k_px: int) -> None:
    surface = stage.OrdinalSurface(SurfaceParameters(k_px=k_px), WIDTH, HEIGHT, table=eros.value_table)
    events = packets()[0].events
    for drawn in (EventBatch.empty(), *(events[n : n + 3] for n in range(len(events))), events):
        levels, _ = surface.drawn(drawn)
        assert levels.any() == bool(len(drawn))
        surface.clear(drawn)
        assert not levels.any(), "a view"


@pytest.mark.parametrize("cleaning", ["off", "isolated", "printed"])
@pytest.mark.parametrize(
    "window",
    [(0, 0, WIDTH, HEIGHT), (7, 5, 30, 21), (-9, -9, 12, 12), (40, 25, 99, 99), (5, 5, 5, 9)],
)
def test_cleaned_clips_and_cuts_out_of_the_whole(cleaning: str, window: tuple[int, int, int, int]) -> None:
    values = run(SurfaceParameters(k_px=3))[-1].values
    x0, y0, x1, y1 = window
    expected = cleaned(values, cleaning)[max(y0, 0) : y1, max(x0, 0) : x1]
    assert np.array_equal(SurfaceResult(values, cleaning).cleaned(*window), expected)


def test_windows_beside_the_image_are_empty() -> None:
    result = run(SurfaceParameters())[0]
    for window in [(99, 0, 120, 9), (-20, 3, -5, 9), (3, 50, 9, 70), (9, 9, 3, 3)]:
        assert result.cleaned(*window).size == 0


def test_blocks_wider_than_a_byte_counts_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"surface\.k_px = 50 is out of range: 1 to 49 px"):
        SurfaceParameters(k_px=50)


def digest() -> str:
    """One number for what filter and surface say with every setting."""
    surface_settings: list[dict[str, object]] = [
        {"k_px": 10, "cleaning": "isolated"},
        {"k_px": 40, "cleaning": "printed"},
        {"kind": "accumulated"},
        {"kind": "linear", "cleaning": "printed"},
    ]
    shown = hashlib.sha256()

    def show(*arrays: NDArray[np.generic]) -> None:
        for array in arrays:
            shown.update(array.tobytes())

    for mode, changed in zip(filter_stage.MODES, surface_settings, strict=True):
        filters = FilterParameters(mode=mode, logo_mode="trail", threshold_us=900)
        surfaces = SurfaceParameters().with_values(changed)
        filter_state, state = filter_stage.start(filters, CONTEXT), stage.start(surfaces, CONTEXT)
        for packet in packets(ticks=4, events_a_tick=60):
            filtered = filter_stage.step(filters, filter_state, packet)
            result = stage.step(surfaces, state, packet, filtered)
            show(filtered.surface_events.t_us, filtered.logo_events.t_us, result.values)
            show(result.cleaned(0, 0, WIDTH, HEIGHT))
    return shown.hexdigest()


@pytest.mark.nojit
def test_without_the_jit_everything_is_the_same_and_nothing_overflows() -> None:
    code = (
        "import warnings\n"
        "from tests.pipeline.stages.test_surface import digest\n"
        "warnings.simplefilter('error')\n"
        "import sys; sys.stdout.write(digest())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, digest()), done.stderr
