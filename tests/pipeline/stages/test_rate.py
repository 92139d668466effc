"""Rate: the spin's magnitude from the rhythm of the event rate, or the reason why not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages import logo as logo_stage
from spinscope.pipeline.stages import rate as stage
from spinscope.pipeline.stages.filter import FilterResult
from spinscope.pipeline.stages.rate import RateParameters, RateResult
from spinscope.pipeline.stages.track_result import TrackResult
from tests.spinning_ball import CONTEXT, known_track, no_track, of_shot, packets


def rhythm(spin_rps: float, *, duration_us: int = 100_000, strokes: int = 4, events: int = 400) -> EventBatch:
    """Events in the middle of the ball as `strokes` strokes of a logo come round, seen for a third of a turn."""
    rng = np.random.default_rng(5)
    count = round(events * spin_rps * duration_us * 1e-6)
    turn = rng.integers(0, int(spin_rps * duration_us * 1e-6) + 1, count)
    stroke = 0.33 * (rng.integers(0, strokes, count) + 0.5) / strokes
    t = ((turn + stroke + rng.normal(0, 0.015, count)) / spin_rps * 1e6).astype(np.int64)
    t = np.sort(t[(t >= 0) & (t < duration_us)])
    x, y = rng.integers(635, 645, t.size), rng.integers(355, 365, t.size)
    return EventBatch.checked(t, x, y, rng.random(t.size) < 0.5, width_px=1280, height_px=720)


def rates(
    events: EventBatch, parameters: RateParameters | None = None, tracks: list[TrackResult] | None = None
) -> list[RateResult]:
    """What the stage says tick by tick."""
    group = parameters or RateParameters()
    logo_state, shot = logo_stage.start(logo_stage.LogoParameters(), CONTEXT), None
    results = []
    for number, packet in enumerate(packets(events, until_us=100_000)):
        track = tracks[number] if tracks else known_track(packet.end_us)
        if track.ball is None:
            results.append(stage.absent(group, "no ball"))
            continue
        if track.shot != shot:
            shot, state = track.shot, stage.start(group, CONTEXT)
        filtered = FilterResult(packet.events, packet.events, packet.events)
        seen = logo_stage.step(logo_stage.LogoParameters(), logo_state, packet, filtered, track.ball)
        results.append(stage.step(group, state, packet, track.ball, seen))
    return results


@pytest.mark.parametrize("spin_rps", [25.0, 50.0, 90.0, 140.0])
@pytest.mark.parametrize("strokes", [1, 3, 6])
def test_the_strokes_of_a_logo_do_not_count_as_rotations(spin_rps: float, strokes: int) -> None:
    result = rates(rhythm(spin_rps, strokes=strokes))[-1]
    assert result.spin_rps is not None and result.spin_std_rps is not None, result.reason
    assert result.spin_rps == pytest.approx(spin_rps, rel=0.03)
    assert abs(result.spin_rps - spin_rps) < 4 * result.spin_std_rps + 0.01 * spin_rps


def test_the_spin_is_one_over_the_mean_interval() -> None:
    result = rates(rhythm(60.0))[-1]
    assert result.spin_rps == pytest.approx(1e6 / np.diff(result.crossings_us).mean())
    falling = np.interp(result.crossings_us, result.t_us + 250, result.smooth_hz)
    np.testing.assert_allclose(falling, 0.0, atol=1e-6 * result.ema_hz.max())


def test_the_histogram_holds_the_logo_events_of_the_bins_that_ended() -> None:
    events = rhythm(60.0)
    result = rates(events, RateParameters(bin_us=700))[-1]
    edges = np.append(result.t_us, result.t_us[-1] + 700)
    np.testing.assert_allclose(result.rate_hz * 700e-6, np.histogram(events.t_us, edges)[0])
    assert result.t_us[-1] + 700 <= 100_000 < result.t_us[-1] + 1400


def test_a_fixed_cut_off_is_the_papers_and_may_count_strokes() -> None:
    events = rhythm(25.0, strokes=3)
    fixed = RateParameters(low_pass_from="fixed", low_pass_hz=400.0, ema_us=500)
    assert rates(events, fixed)[-1].low_pass_hz == 400.0
    assert rates(events, fixed)[-1].crossings_us.size > 2 * rates(events)[-1].crossings_us.size


def test_reasons_for_no_spin() -> None:
    steady = np.sort(np.random.default_rng(0).integers(0, 100_000, 5000))
    middle = np.full(5000, 640)
    uniform = EventBatch.checked(steady, middle, middle - 280, middle > 0, width_px=1280, height_px=720)
    for events, word in ((rhythm(50.0, events=4), "are needed"), (uniform, ""), (rhythm(12.0), "crossing")):
        result = rates(events)[-1]
        assert result.spin_rps is None and result.spin_std_rps is None
        assert result.reason and word in result.reason


def test_above_the_highest_spin_there_is_no_answer() -> None:
    slow = dataclasses.replace(CONTEXT, values={"spin.max_spin_rps": 40.0})
    state, group = stage.start(RateParameters(), slow), RateParameters()
    seen = logo_stage.start(logo_stage.LogoParameters(), CONTEXT)
    for packet in packets(rhythm(80.0)):
        track = known_track(packet.end_us)
        filtered = FilterResult(packet.events, packet.events, packet.events)
        logo = logo_stage.step(logo_stage.LogoParameters(), seen, packet, filtered, track.ball)
        result = stage.step(group, state, packet, track.ball, logo)
    assert result.spin_rps is None


def test_a_new_shot_starts_afresh_and_without_a_ball_there_is_nothing() -> None:
    events = rhythm(80.0)
    ends = [packet.end_us for packet in packets(events, until_us=100_000)]
    tracks = [known_track(end_us) for end_us in ends]
    tracks[9] = no_track(ends[9])
    tracks[10:] = [of_shot(track, 1) for track in tracks[10:]]
    results = rates(events, tracks=tracks)
    assert results[8].t_us[0] == 0 and results[8].spin_rps is not None
    assert results[9].t_us.size == 0 and results[9].reason == "no ball"
    assert results[10].t_us[0] == 50_000 and results[10].spin_rps is None
    assert results[-1].spin_rps == pytest.approx(80.0, rel=0.03)


def test_it_looks_back_over_the_window_only() -> None:
    result = rates(rhythm(80.0), RateParameters(window_us=60_000))[-1]
    assert result.t_us[0] == 40_000 and result.t_us.size == 120


def test_ticks_of_another_length_than_the_bins_give_the_same_bins() -> None:
    events = rhythm(60.0)
    group, state = RateParameters(bin_us=700), stage.start(RateParameters(), CONTEXT)
    logo_state = logo_stage.start(logo_stage.LogoParameters(), CONTEXT)
    for start_us in range(0, 100_000, 1000):
        packet = Packet(start_us // 1000, start_us, start_us + 1000, events.between(start_us, start_us + 1000))
        track = known_track(packet.end_us)
        filtered = FilterResult(packet.events, packet.events, packet.events)
        logo = logo_stage.step(logo_stage.LogoParameters(), logo_state, packet, filtered, track.ball)
        result = stage.step(group, state, packet, track.ball, logo)
    np.testing.assert_array_equal(result.rate_hz, rates(events, group)[-1].rate_hz)
