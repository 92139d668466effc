"""The contrast score against its twin, its search against truth, and its laws."""

from __future__ import annotations

import itertools
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.spin.contrast import estimate, search
from spinscope.pipeline.spin.contrast.estimate import estimate_spin, follow_spin
from spinscope.pipeline.spin.contrast.events import (
    LATENCY_SPREAD_S,
    BallUncertainty,
    ContrastEstimate,
    ContrastSettings,
    EventColumns,
    SphereEvents,
    offset_slopes,
    segment_starts,
    segmented_window,
    shifted_normals,
    whole_window,
)
from spinscope.pipeline.spin.contrast.score import score, take_logarithms
from spinscope.pipeline.spin.contrast.search import distinct, even_span_s, without_strays
from tests.reference.contrast import dotted_ball, naive_score
from tests.reference.rotation import turned

BALL = BallUncertainty(centre_std_px=0.2, radius_std_px=0.2)
SPIN = np.array([40.0, -25.0, 20.0])
MIRROR = np.array([1.0, -1.0, -1.0])  # of an axial vector, for x -> -x


def answer_of(events: SphereEvents, ball: BallUncertainty = BALL) -> ContrastEstimate:
    return estimate_spin(events, ball, ContrastSettings())


def assert_same(spin: np.ndarray | None, expected: np.ndarray, part: float = 0.02) -> None:
    assert spin is not None
    assert np.linalg.norm(spin - expected) < part * np.linalg.norm(expected)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 30).filter(lambda count: count != 2),
    speed=st.floats(0.0, 900.0),
    spread=st.floats(0.02, 2.0),
    segment_s=st.sampled_from([1.0, 0.004]),
    times_each=st.integers(1, 3),
    cell=st.sampled_from([0.03, 0.1, 0.2]),
    floor=st.floats(0.1, 5.0),
    apart_s=st.sampled_from([0.0, 0.002]),
)
def test_the_score_is_its_twins(seed, count, speed, spread, segment_s, times_each, cell, floor, apart_s) -> None:
    # Of two points the mean is an eigenvector of their scatter, by which the map's pole is found: where it is that of
    # the smaller eigenvalue, rounding decides where the pole lies.
    random = np.random.default_rng(seed)
    normals = np.array([[0.0], [0.2], [-1.0]]) + spread * random.standard_normal((3, count))
    normals /= np.linalg.norm(normals, axis=0)
    t_s, polarity = np.sort(random.uniform(-0.01, 0.01, count)), random.integers(0, 2, count)
    events = EventColumns(t_s, normals, polarity, np.array([0, count]))
    direction = random.standard_normal(3)
    spin = speed * direction / np.linalg.norm(direction)
    if segment_s == 1.0:
        window = whole_window(events, times_each, apart_s)
    else:
        window = segmented_window(events, segment_s, 10_000, 10_000)
        times_each, apart_s = 1, 0.0
    ratios = np.empty(count)
    total = score(ratios, spin, window, cell, floor)
    expected, shares = naive_score(spin, *window.events, times_each, cell, floor, apart_s)
    np.testing.assert_allclose(ratios, shares, atol=2e-4)
    assert total == pytest.approx(expected, abs=2e-4 * count)


@pytest.mark.parametrize("turned_rad", [0.0, 0.7, 1.5])
def test_a_stamp_counts_as_much_on_either_side_of_the_ball(turned_rad) -> None:
    """Strokes, and the same through the ball's centre: each scores what both score, and what they score alone."""
    random = np.random.default_rng(0)
    along, across = random.uniform(-0.5, 0.5, 400), 0.02 * random.standard_normal(400)
    x, y = np.where(np.arange(400) % 2, (along, across), (across + 0.2, along))
    stamp = np.stack([x, y, np.ones(400)]) / np.sqrt(x**2 + y**2 + 1.0)
    stamp = turned(stamp.T, np.array([turned_rad, 0.0, 0.0]) / (2 * np.pi), np.ones(400)).T
    spin, t_s, polarity = 2 * np.pi * SPIN, np.sort(random.uniform(-0.02, 0.02, 400)), np.zeros(400, np.int64)
    seen = turned(stamp.T, SPIN, t_s).T

    def shares(normals: np.ndarray, repeated: int) -> np.ndarray:
        events = EventColumns(
            np.repeat(t_s, repeated), normals, np.repeat(polarity, repeated), np.array([0, 400 * repeated])
        )
        ratios = np.empty(400 * repeated)
        score(ratios, spin, whole_window(events, 3, 0.0), 0.04, 1.5)
        return ratios.reshape(400, repeated).sum(axis=0)

    (alone,) = shares(np.ascontiguousarray(seen), 1)
    sides = shares(np.stack([seen, -seen], axis=2).reshape(3, 800), 2)
    assert sides == pytest.approx([alone, alone], rel=0.05)


def test_logarithms_are_the_librarys() -> None:
    values = np.concatenate([np.geomspace(1e-3, 1e3, 400), [1.0, 2.0, math.sqrt(2.0), 1.0 - 1e-9]])
    expected = np.log(values)
    assert take_logarithms(values) == pytest.approx(expected.sum(), abs=1e-9)
    np.testing.assert_allclose(values, expected, atol=1e-11)


@settings(max_examples=50)
@given(st.lists(st.floats(0, 0.1), min_size=1, max_size=50), st.floats(1e-3, 0.05))
def test_segments_hold_each_event_once_and_are_short(times, segment_s) -> None:
    t_s = np.sort(np.array(times))
    starts = segment_starts(t_s, segment_s)
    assert starts[0] == 0
    assert starts[-1] == t_s.size
    assert np.all(np.diff(starts) > 0)
    assert all(np.ptp(t_s[a:b]) <= segment_s * (1 + 1e-9) for a, b in itertools.pairwise(starts))


def test_distinct_spins_are_apart() -> None:
    spins = np.array([[10.0, 0, 0], [10.2, 0, 0], [0, 10, 0], [12, 0, 0], [0, 0, 9]])
    assert list(distinct(spins, 0.1, 9, 0)) == [0, 2, 3, 4]
    assert list(distinct(spins, 0.1, 2, 0)) == [0, 2]
    assert list(distinct(spins, 0.1, 9, 1)) == [0, 2, 4]  # 12 crowds 10


@pytest.mark.parametrize("offsets", [(0.4, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 0.4), (0.2, 0.2, -0.3)])
def test_offsets_move_the_normals_as_a_shifted_disc_does(offsets) -> None:
    """A ball far away on the optical axis: (x, y) on the disc over the radius is the normal's x, y."""
    radius, rng = 17.0, np.random.default_rng(0)
    disc = rng.uniform(-10, 10, (2, 30))
    x, y, wider = offsets

    def normals_of(px: np.ndarray, of_radius: float) -> np.ndarray:
        across = px / of_radius
        return np.stack([*across, -np.sqrt(1 - (across**2).sum(axis=0))])

    facing = np.repeat([[0.0], [0.0], [1.0]], 30, axis=1)
    before = normals_of(disc, radius)
    moved = shifted_normals(before, offset_slopes(before, facing, np.full(30, radius)), np.array(offsets))
    after = normals_of(disc - np.array([[x], [y]]), radius + wider)
    assert np.abs(moved - after).max() < 0.1 * np.abs(before - after).max() + 1e-4
    np.testing.assert_allclose(np.linalg.norm(moved, axis=0), 1.0, atol=1e-12)


@pytest.mark.parametrize("spin", [SPIN, [-8.0, 2.0, 3.0], [0.0, 0.0, 90.0], [10.0, 110.0, -40.0]])
def test_the_spin_is_found_from_nothing(spin) -> None:
    answer = answer_of(dotted_ball(np.array(spin)))
    assert_same(answer.spin_rps, np.array(spin))
    assert answer.contrast > 1.0


@pytest.mark.parametrize("seed", [0, 2, 3, 6, 8])
def test_a_logo_of_few_events_that_is_always_in_view_is_found(seed) -> None:
    """Ten events in half a millisecond are no burst: the search does not rest on those that happen to coincide."""
    spin = np.array([0.0, 0.0, 90.0])
    assert_same(answer_of(dotted_ball(spin, seed=seed)).spin_rps, spin)


def test_a_start_with_the_wrong_number_of_turns_is_put_right() -> None:
    events = dotted_ball(SPIN, duration_s=0.06)
    answer = estimate_spin(events, BALL, ContrastSettings(), starts_rps=0.6 * SPIN[None], searching=False)
    assert_same(answer.spin_rps, SPIN)


def test_a_scan_where_nothing_turns_still_names_its_best(monkeypatch) -> None:
    """Permuted times can beat every spin: all scores are negative then."""
    usual = estimate.maximise_each

    def lowered(hill, spins, iterations):
        tops, values, shares = usual(hill, spins, iterations)
        return tops, values - values.max() - 1.0, shares

    monkeypatch.setattr(estimate, "maximise_each", lowered)
    spins = estimate.alias_scan(dotted_ball(SPIN), 2 * np.pi * SPIN[None], ContrastSettings())
    assert_same(spins[0] / (2 * np.pi), SPIN)


def test_a_scan_finds_the_axis_of_the_rhythm() -> None:
    """From a start four times as fast about another axis, whose aliases do not reach it."""
    start, magnitude = 4.0 * np.roll(SPIN, 1), float(np.linalg.norm(SPIN))
    for rhythms, found in ((np.empty(0), False), (np.array([magnitude]), True)):
        spins = estimate.alias_scan(dotted_ball(SPIN), 2 * np.pi * start[None], ContrastSettings(), rhythms)
        apart = np.linalg.norm(spins / (2 * np.pi) - SPIN, axis=1).min()
        assert (apart < 0.1 * magnitude) == found


def test_following_goes_on_from_an_answer() -> None:
    events = dotted_ball(SPIN, duration_s=0.04, events=900)
    first = answer_of(events.at(events.t_s < 0.012))
    answer = follow_spin(events, BALL, ContrastSettings(), first)
    assert_same(answer.spin_rps, SPIN, 0.01)
    assert answer.span_s > first.span_s


def test_a_turned_scene_turns_the_spin() -> None:
    events = dotted_ball(SPIN)
    turn = turned(np.eye(3), np.array([0.06, -0.14, 0.2]), np.ones(3)).T
    scene = replace(events, normals=turn @ events.normals, facing=turn @ events.facing)
    assert_same(answer_of(scene).spin_rps, turn @ answer_of(events).spin_rps, 0.01)


def test_reversed_time_reverses_the_spin() -> None:
    events = dotted_ball(SPIN)
    back = replace(events.at(np.arange(len(events))[::-1]), t_s=-events.t_s[::-1].copy())
    assert_same(answer_of(back).spin_rps, -answer_of(events).spin_rps, 0.01)


def test_a_mirrored_image_mirrors_the_spin() -> None:
    events = dotted_ball(SPIN)
    flip = np.array([[-1.0], [1.0], [1.0]])
    mirrored = replace(events, normals=events.normals * flip, facing=events.facing * flip)
    assert_same(answer_of(mirrored).spin_rps, MIRROR * answer_of(events).spin_rps, 0.01)


def test_a_larger_ball_turns_the_same() -> None:
    events = dotted_ball(SPIN)
    larger = replace(events, radius_px=2 * events.radius_px)
    answer = answer_of(larger, BallUncertainty(centre_std_px=0.4, radius_std_px=0.4))
    assert_same(answer.spin_rps, answer_of(events).spin_rps, 0.01)


def test_the_same_events_give_the_same_answer() -> None:
    one, two = answer_of(dotted_ball(SPIN)), answer_of(dotted_ball(SPIN))
    assert np.array_equal(one.spin_rps, two.spin_rps)
    assert np.array_equal(one.covariance_rps2, two.covariance_rps2)


def test_the_stated_error_grows_with_what_is_not_known() -> None:
    events = dotted_ball(SPIN, duration_s=0.01, events=300)
    spreads = []
    for some, px in ((events, 0.1), (events, 1.0), (events.thinned(100), 0.1)):
        answer = answer_of(some, BallUncertainty(centre_std_px=px, radius_std_px=px))
        covariance = answer.covariance_rps2
        assert covariance is not None
        assert np.linalg.eigvalsh(covariance).min() > 0
        spreads.append(float(np.trace(covariance)))
    assert spreads[1] > spreads[0]
    assert spreads[2] > spreads[0]


DRIFT_PX_S = 30.0


def drift_covariance(events: SphereEvents, **rising: float) -> np.ndarray:
    """What a drifting track adds to the stated covariance; rps^2."""
    steady = answer_of(events).covariance_rps2
    drifting = answer_of(events, BallUncertainty(centre_std_px=0.2, radius_std_px=0.2, **rising)).covariance_rps2
    return drifting - steady


def test_a_drifting_track_looks_like_a_turn_in_the_image_across_the_spins_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "_twist", lambda *_: np.zeros((3, 3)))  # what a ball in flight adds besides
    events = dotted_ball(SPIN, duration_s=0.01, events=300)
    axis = answer_of(events).spin_rps
    across = np.eye(3) - np.outer(axis, axis) / (axis @ axis)
    ramp_px = DRIFT_PX_S * even_span_s(without_strays(events))
    for rising in (
        {"drift_std_px_s": DRIFT_PX_S, "track_std_px": 9.0},
        {"drift_std_px_s": 9e9, "track_std_px": ramp_px / 12**0.5},
        {"speed_px_s": ramp_px / LATENCY_SPREAD_S},
    ):
        in_image = (DRIFT_PX_S / 17.0 / (2 * np.pi)) ** 2 * np.diag([1.0, 1.0, 0.0])
        added = across @ drift_covariance(events, **rising) @ across
        np.testing.assert_allclose(added, across @ in_image @ across, rtol=0.05, atol=1e-6)


def test_a_drifting_track_changes_the_magnitude_as_much_as_is_stated() -> None:
    events = dotted_ball(SPIN, duration_s=0.06, events=900)  # three turns: the axis takes none of it
    slopes = offset_slopes(events.normals, events.facing, events.radius_px)
    since_s = events.t_s - events.t_s.mean()
    plain = answer_of(events).spin_rps
    axis = plain / np.linalg.norm(plain)
    changes = []
    for shift in np.eye(2):
        shifted = events.normals + DRIFT_PX_S * since_s * np.einsum("k,kin->in", shift, slopes[:2])
        drifting = replace(events, normals=shifted / np.linalg.norm(shifted, axis=0))
        changes.append(axis @ (answer_of(drifting).spin_rps - plain))
    stated = axis @ drift_covariance(events, drift_std_px_s=DRIFT_PX_S, track_std_px=9.0) @ axis
    assert math.sqrt(stated) == pytest.approx(math.hypot(*changes), rel=0.3)


def test_a_logo_near_the_axis_tells_the_magnitude_less_well() -> None:
    """The same errors on the ball are a turn that many times larger."""
    events = dotted_ball(np.array([0.0, 0.0, 40.0]), duration_s=0.02, events=900)
    from_axis = np.degrees(np.arccos(-events.normals[2]))
    stds = []
    for near in (from_axis < 25, from_axis > 45):
        some = events.at(near)
        model = answer_of(some)
        assert model.spin_rps is not None
        stds.append(math.sqrt(model.covariance_rps2[2, 2]))
    assert stds[0] > 1.5 * stds[1]


def test_margins_are_in_sigmas_of_independent_events() -> None:
    """Four times as many events that tell the same are worth half the sigmas, and twice the events' own error."""
    events = dotted_ball(SPIN, duration_s=0.012, events=300)
    one, four = (
        estimate_spin(events, BALL, ContrastSettings(repeats=repeats), starts_rps=np.stack([SPIN, -SPIN]))
        for repeats in (8.0, 32.0)
    )
    assert one.margins.size
    np.testing.assert_allclose(four.margins, 0.5 * one.margins, rtol=1e-6)
    assert np.trace(four.covariance_rps2) > np.trace(one.covariance_rps2)


def test_a_flight_with_its_tracks_errors_leads_by_less_than_a_ball_in_place() -> None:
    events = dotted_ball(SPIN, duration_s=0.012, events=300)
    in_place, flying = (
        estimate_spin(
            events, replace(BALL, speed_px_s=speed_px_s), ContrastSettings(), starts_rps=np.stack([SPIN, -SPIN])
        )
        for speed_px_s in (0.0, 1.0)
    )
    assert in_place.margins.size
    np.testing.assert_allclose(in_place.margins, 1.5 * flying.margins, rtol=1e-6)


def test_noise_has_no_contrast() -> None:
    events = dotted_ball(SPIN)
    noise = replace(events, t_s=np.sort(np.random.default_rng(1).permutation(events.t_s)))
    noise = replace(noise, normals=np.ascontiguousarray(noise.normals[:, np.random.default_rng(2).permutation(600)]))
    assert answer_of(noise).contrast < 0.25


def test_too_few_events_give_nothing() -> None:
    assert answer_of(dotted_ball(SPIN, events=39)).spin_rps is None


TINY = """
import json
import numpy as np
from spinscope.pipeline.spin.contrast.events import offset_slopes, whole_window
from spinscope.pipeline.spin.contrast.score import Objective
from spinscope.pipeline.spin.contrast.search import distinct, grid_search, maximise
from tests.reference.contrast import dotted_ball

events = dotted_ball(np.array([20.0, 5.0, 5.0]), duration_s=0.01, events=30)
slopes = offset_slopes(events.normals, events.facing, events.radius_px)
spin = 2 * np.pi * np.array([19.0, 5.0, 6.0])
objective = Objective(whole_window(events.columns, 2, 0.0), slopes, 0.08, 1.5, np.full(3, 0.3), 0.1)
spin, offsets, value, model = maximise(objective, spin, np.zeros(3), 1)
grid = grid_search(events.columns, 4.0, 1.5, 30, 1)
print(json.dumps([*spin, *offsets, value, *model.curvature.ravel(), *grid[0]]))
"""


@pytest.mark.nojit
def test_without_compilation_the_kernels_say_the_same() -> None:
    def numbers(**environment: str) -> list[float]:
        ran = subprocess.run(
            [sys.executable, "-c", TINY],
            env={**os.environ, **environment, "PYTHONPATH": "."},
            capture_output=True,
            text=True,
            check=True,
        )
        return [float(value) for value in ran.stdout.strip("[]\n").split(",")]

    np.testing.assert_allclose(numbers(NUMBA_DISABLE_JIT="1"), numbers(), rtol=1e-4, atol=1e-4)
