"""The filter stage: two filters over one packet, their state from packet to packet."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import filter as stage
from spinscope.pipeline.stages.filter import MODES, FilterParameters
from tests.reference.filter import NaiveFilter

WIDTH, HEIGHT, TICK_US = 9, 7, 1000
CONTEXT = Context(Camera.of(CameraParameters(), WIDTH, HEIGHT), 0.02, {"spin.max_spin_rps": 150.0})
START_US = 1_600_000_000_000_000


def packets(seed: int, ticks: int = 6, events_a_tick: int = 150) -> list[Packet]:
    """Random events; the third tick has none."""
    rng = np.random.default_rng(seed)
    result = []
    for index in range(ticks):
        start_us, count = START_US + index * TICK_US, 0 if index == 2 else events_a_tick
        batch = EventBatch(
            np.sort(rng.integers(start_us, start_us + TICK_US, count)),
            rng.integers(0, WIDTH, count).astype(np.uint16),
            rng.integers(0, HEIGHT, count).astype(np.uint16),
            rng.random(count) < 0.7,
        )
        result.append(Packet(index, start_us, start_us + TICK_US, batch))
    return result


def rows(batch: EventBatch) -> list[tuple[int, int, int, bool]]:
    return list(zip(batch.t_us.tolist(), batch.x_px.tolist(), batch.y_px.tolist(), batch.on.tolist(), strict=True))


@pytest.mark.parametrize(("mode", "contour_mode", "logo_mode"), list(itertools.product(MODES, MODES, MODES)))
@pytest.mark.parametrize("logo_threshold_us", [200, 500])
def test_any_three_filters_equal_three_twins(
    mode: str, contour_mode: str, logo_mode: str, logo_threshold_us: int
) -> None:
    parameters = FilterParameters(
        mode=mode,
        threshold_us=200,
        contour_mode=contour_mode,
        contour_threshold_us=300,
        logo_mode=logo_mode,
        logo_threshold_us=logo_threshold_us,
    )
    state = stage.start(parameters, CONTEXT)
    twins = NaiveFilter(mode, 200), NaiveFilter(contour_mode, 300), NaiveFilter(logo_mode, logo_threshold_us)
    for packet in packets(seed=1):
        result = stage.step(parameters, state, packet)
        batches = result.surface_events, result.contour_events, result.logo_events
        for batch, twin in zip(batches, twins, strict=True):
            assert rows(batch) == [e for e in rows(packet.events) if twin.passes(*e)]


def test_equal_settings_are_filtered_once_and_off_copies_nothing() -> None:
    (packet, *_) = packets(seed=2)
    same = FilterParameters(
        mode="trail",
        threshold_us=300,
        contour_mode="trail",
        contour_threshold_us=300,
        logo_mode="trail",
        logo_threshold_us=300,
    )
    result = stage.step(same, stage.start(same, CONTEXT), packet)
    assert result.surface_events is result.contour_events is result.logo_events
    default = FilterParameters()
    result = stage.step(default, stage.start(default, CONTEXT), packet)
    assert result.contour_events is result.logo_events
    off = FilterParameters(mode="off", logo_mode="stc")
    result = stage.step(off, stage.start(off, CONTEXT), packet)
    assert result.surface_events is packet.events
    assert 0 < len(result.logo_events) < len(packet.events)
    all_off = FilterParameters(mode="off", contour_mode="off", logo_mode="off", threshold_us=1)
    result = stage.step(all_off, stage.start(all_off, CONTEXT), packet)
    assert result.surface_events is result.contour_events is result.logo_events is packet.events


@pytest.mark.parametrize("lamps", ["mains_50hz", "mains_60hz"])
def test_flicker_is_taken_out_before_the_filters_and_handed_on(lamps: str) -> None:
    beat_us = {"mains_50hz": 10_000, "mains_60hz": 8_333}[lamps]
    parameters = FilterParameters(lamps=lamps, mode="trail", threshold_us=200, contour_mode="off", logo_mode="off")
    state = stage.start(parameters, CONTEXT)
    shown: list[tuple[int, int, int, bool]] = []
    removed: list[tuple[int, int, int, bool]] = []
    first_us = START_US // TICK_US * TICK_US
    for index in range(60):
        start_us = first_us + index * TICK_US
        (noise, *_) = packets(seed=index, ticks=1, events_a_tick=3)
        t = noise.events.t_us - START_US + start_us
        beats = np.array([b for b in range(first_us, first_us + 60_000, beat_us) if start_us <= b < start_us + TICK_US])
        lamp = EventBatch(
            beats.astype(np.int64), np.full(beats.size, 4, np.uint16), np.full(beats.size, 3, np.uint16), beats > 0
        )
        both = EventBatch.concatenate([EventBatch(t, noise.events.x_px, noise.events.y_px, noise.events.on), lamp])
        order = np.argsort(both.t_us, kind="stable")
        packet = Packet(index, start_us, start_us + TICK_US, EventBatch(*(c[order] for c in both.columns)))
        result = stage.step(parameters, state, packet)
        assert sorted(rows(result.logo_events) + rows(result.flicker_events)) == sorted(rows(packet.events))
        shown += rows(result.surface_events)
        removed += rows(result.flicker_events)
    assert {event[1:3] for event in removed if event[0] % beat_us == first_us % beat_us} == {(4, 3)}
    assert len([event for event in removed if event[1:3] == (4, 3)]) >= 4
    assert len(removed) < 12  # 180 of noise: hardly any comes again twice
    assert not set(removed) & set(shown)
