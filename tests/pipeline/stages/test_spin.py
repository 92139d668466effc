"""Spin: both methods on balls whose spin is known, the laws they keep, and when they refuse."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import trusted_method
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.spin.triplet import TripletSpin
from spinscope.pipeline.stages.flow import FlowEvents, FlowResult
from spinscope.pipeline.stages.rate import RateResult
from tests.reference.sphere import image_velocity
from tests.spinning_ball import (
    CAMERA,
    CONTEXT,
    after_track,
    errors,
    known_track,
    no_track,
    of_shot,
    packets,
    spinning_ball,
)

METHODS = ("triplet", "normal_flow")
ROOT = Path(__file__).parents[3]
SILENT = RateResult(  # type: ignore[arg-type]
    *(np.empty(0),) * 4, 200.0, np.empty(0), None, None, "nothing yet", np.empty(0), np.empty(0), np.nan, "nothing yet"
)
STILL = {"centre_m": (0.0, 0.0, 2.0), "velocity_m_s": (0.0, 0.0, 0.0)}
FLIGHT = {"centre_m": (0.05, -0.2, 1.75), "velocity_m_s": (1.0, 6.0, -0.3)}
CASES = {
    "top, in place": ((50.0, 0.0, 0.0), (0.0, 0.0, -1.0), STILL),
    "side, logo at 45 degrees": ((0.0, 0.0, 50.0), (0.7, 0.0, -0.7), STILL),
    "mixed, off the axis": ((-30.0, 10.0, 20.0), (0.3, 0.3, -0.9), {**STILL, "centre_m": (0.2, 0.1, 1.8)}),
    "top, flying": ((40.0, -8.0, 12.0), (0.0, 0.0, -1.0), FLIGHT),
    "back, flying": ((-60.0, 8.0, 12.0), (0.0, 0.0, -1.0), FLIGHT),
}


@cache
def events_of(case: str) -> EventBatch:
    spin_rps, towards, motion = CASES[case]
    return spinning_ball(np.array(spin_rps), towards=towards, **motion)


def spins(events: EventBatch, motion: dict, **parameters: object) -> list[dict[str, SpinEstimate]]:
    """What the stage says tick by tick."""
    ticks = [(packet, known_track(packet.end_us, **motion)) for packet in packets(events)]
    return [result[3] for result in after_track(ticks, parameters=SpinParameters(**parameters))]


def last(case: str, method: str = "normal_flow", **parameters: object) -> SpinEstimate:
    return spins(events_of(case), CASES[case][2], **parameters)[-1][method]


@pytest.mark.parametrize("case", CASES)
def test_normal_flow_finds_the_spin(case: str) -> None:
    results = spins(events_of(case), CASES[case][2])
    estimate = results[-1]["normal_flow"]
    off_rps, off_deg = errors(estimate, np.array(CASES[case][0]))
    assert abs(off_rps) < 2.0 and off_deg < (5.0 if case == "back, flying" else 1.5)
    assert off_deg < 3 * estimate.axis_std_deg
    assert trusted_method(results[-1]) == "normal_flow"


@pytest.mark.parametrize("case", ["top, in place", "side, logo at 45 degrees", "top, flying"])
def test_each_tick_says_what_is_known_so_far(case: str) -> None:
    """After 10 ms, a fifth to a half of a rotation, the axis is known to a few degrees already."""
    for number, result in enumerate(spins(events_of(case), CASES[case][2])):
        assert set(result) == set(METHODS)
        estimate = result["normal_flow"]
        if estimate.vector_rps is not None:
            off_rps, off_deg = errors(estimate, np.array(CASES[case][0]))
            assert off_deg < 4 * estimate.axis_std_deg + 1
        if number >= 6 and estimate.vector_rps is not None:
            assert off_deg < 4 and abs(off_rps) < 4


def mirrored(events: EventBatch) -> EventBatch:
    """Left and right exchanged about the middle of the image."""
    return EventBatch(events.t_us.copy(), (1279 - events.x_px).astype(np.uint16), events.y_px.copy(), events.on.copy())


def upside_down(events: EventBatch) -> EventBatch:
    """Turned by half a turn about the optical axis."""
    turned = mirrored(events)
    return EventBatch(turned.t_us.copy(), turned.x_px.copy(), (719 - events.y_px).astype(np.uint16), turned.on.copy())


def backwards(events: EventBatch) -> EventBatch:
    """Time reversed: what arrived first arrives last, and every edge is of the other kind."""
    return EventBatch(
        (50_000 - events.t_us[::-1]).copy(), events.x_px[::-1].copy(), events.y_px[::-1].copy(), ~events.on[::-1]
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ["top, in place", "mixed, off the axis"])
def test_laws_of_symmetry(case: str, method: str) -> None:
    """Turning the scene turns the spin, a mirror keeps the part along its own axis, time reversed reverses it."""
    events, motion = events_of(case), CASES[case][2]
    x, y, z = motion["centre_m"]
    here = spins(events, motion, magnitude_from="flow")[-1][method].vector_rps
    for change, signs, place in (
        (upside_down, (-1, -1, 1), (-x, -y, z)),
        (mirrored, (1, -1, -1), (-x, y, z)),
        (backwards, (-1, -1, -1), (x, y, z)),
    ):
        there = spins(change(events), {**motion, "centre_m": place}, magnitude_from="flow")[-1][method]
        assert here is not None and there.vector_rps is not None
        tolerance = (0.02 if method == "normal_flow" else 0.2) * np.linalg.norm(here)
        np.testing.assert_allclose(there.vector_rps, np.array(signs) * here, atol=tolerance)


def test_a_ball_twice_as_large_twice_as_far_away_is_the_same() -> None:
    """All that the camera sees is the same, and so is the spin."""
    motion = CASES["mixed, off the axis"][2]
    large = dataclasses.replace(CONTEXT, ball_radius_m=0.04)
    place = {**motion, "centre_m": tuple(2 * c for c in motion["centre_m"])}
    events = events_of("mixed, off the axis")
    ticks = [(packet, known_track(packet.end_us, **place, context=large)) for packet in packets(events)]
    for method, estimate in after_track(ticks, context=large)[-1][3].items():
        assert estimate.vector_rps is not None
        np.testing.assert_allclose(estimate.vector_rps, last("mixed, off the axis", method).vector_rps, atol=0.05)


def perfect_flow(seed: int, spin_rad_s: np.ndarray) -> FlowResult:
    """Exact flow of points all over the visible side of a ball off the axis, in five slices."""
    rng = np.random.default_rng(seed)
    centre = np.array([0.2, -0.1, 1.8])
    e = rng.normal(size=(200, 3))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    e[e @ centre > 0] *= -1
    e = e[e @ centre / np.linalg.norm(centre) < -0.4]
    points = centre + 0.02 * e
    u = image_velocity(points, e, spin_rad_s, CAMERA.focal_px, 0.02)
    n = len(e)
    none = np.empty(0)
    events = FlowEvents(np.arange(n), np.zeros(n), np.zeros(n), np.ones(n, np.bool_), points, e, *np.zeros((3, n)))
    no_normal_flow = FlowEvents.empty(), np.empty((0, 2)), none, np.empty(0, np.bool_)
    return FlowResult(2000, 1e5, 17.0, events, u[:, 0].copy(), u[:, 1].copy(), np.arange(n) * 5 // n, *no_normal_flow)


def triplet(flow: FlowResult, solve: str) -> np.ndarray:
    method = TripletSpin(SpinParameters(triplet_solve=solve), CONTEXT)
    vector = method.estimate(10_000, flow, SILENT).vector_rps
    assert vector is not None
    return vector


@settings(max_examples=40)
@given(seed=st.integers(0, 1000), spin=st.tuples(*[st.floats(-80, 80)] * 3))
def test_full_rank_finds_any_spin_exactly_and_the_paper_loses_what_lies_along_e_r(
    seed: int, spin: tuple[float, float, float]
) -> None:
    spin_rps = np.array(spin)
    flow = perfect_flow(seed, 2 * np.pi * spin_rps)
    np.testing.assert_allclose(triplet(flow, "least_squares"), spin_rps, atol=1e-6)
    kept = [
        np.mean(
            [(np.eye(3) - np.outer(e, e)) @ spin_rps for e in flow.events.normals[flow.slice_index == number]], axis=0
        )
        for number in range(5)
    ]
    np.testing.assert_allclose(triplet(flow, "paper"), np.mean(kept, axis=0), atol=1e-6)


def test_the_paper_sees_half_of_a_sidespin_with_the_logo_at_45_degrees() -> None:
    """The mean of e_r x v loses the half of the spin that lies along the logo's direction."""
    flow_only = last("side, logo at 45 degrees", "triplet", magnitude_from="flow")
    off_rps, off_deg = errors(flow_only, np.array([0.0, 0.0, 50.0]))
    assert off_rps == pytest.approx(-25, abs=4) and off_deg < 10
    full = last("side, logo at 45 degrees", "triplet", magnitude_from="flow", triplet_solve="least_squares")
    assert abs(errors(full, np.array([0.0, 0.0, 50.0]))[0]) < 5


def test_the_event_rate_gives_the_magnitude_where_it_has_a_rhythm() -> None:
    sharp, plain = last("top, in place", "triplet"), last("top, in place", "triplet", magnitude_from="flow")
    assert sharp.magnitude_rps == pytest.approx(50.0, abs=1.0) != plain.magnitude_rps
    np.testing.assert_allclose(sharp.axis, plain.axis, atol=1e-9)
    sharp, plain = last("top, in place"), last("top, in place", magnitude_from="flow")
    assert sharp.magnitude_std_rps < plain.magnitude_std_rps
    assert abs(sharp.magnitude_rps - 50.0) < 1.0


def test_full_rank_needs_more_than_one_side() -> None:
    flow = perfect_flow(0, np.array([200.0, 100.0, 50.0]))
    near = np.zeros(len(flow.events.normals), np.bool_)
    near[np.argsort(flow.events.normals @ flow.events.normals[0])[-3:]] = True
    columns = {name: getattr(flow, name)[near] for name in ("events", "vx_px_s", "vy_px_s", "slice_index")}
    columns["events"] = dataclasses.replace(columns["events"], normals=np.tile(flow.events.normals[0], (3, 1)))
    one_side = dataclasses.replace(flow, **columns)
    method = TripletSpin(SpinParameters(triplet_solve="least_squares"), CONTEXT)
    assert "one side" in (method.estimate(10_000, one_side, SILENT).reason or "")


def test_no_ball_and_no_logo_are_refusals_with_reasons() -> None:
    events = events_of("top, in place")
    ticks = [(packet, no_track(packet.end_us)) for packet in packets(events)]
    for _, _, _, result in after_track(ticks):
        assert trusted_method(result) is None
        assert {e.reason for e in result.values()} == {"no ball"}
    empty = [
        (dataclasses.replace(packet, events=EventBatch.empty()), known_track(packet.end_us)) for packet, _ in ticks
    ]
    result = after_track(empty)[-1][3]
    assert trusted_method(result) is None
    assert result["triplet"].reason == "no flow"
    assert "hardly seen" in (result["normal_flow"].reason or "")


def test_an_outline_that_bleeds_into_the_mask_is_no_logo() -> None:
    """A flight without logo: OFF events behind the ball and ON before it, up to 4 px inside the mask."""
    rng = np.random.default_rng(2)
    t = np.sort(rng.integers(0, 50_000, 4000))
    angle, depth = rng.uniform(-1.0, 1.0, 4000), np.abs(rng.normal(0, 1.2, 4000))
    on = rng.random(4000) < 0.2
    track = known_track(50_000, **FLIGHT)
    direction = np.arctan2(track.mean[3], track.mean[2]) + angle + np.where(on, 0, np.pi)
    assert track.ball is not None
    x, y = track.ball.centre_px(t)
    away = track.mean[4] - 2.5 - depth
    x, y = np.round(x + away * np.cos(direction)), np.round(y + away * np.sin(direction))
    events = EventBatch.checked(t, x, y, on, width_px=1280, height_px=720)
    results = spins(events, FLIGHT)
    assert all(result["normal_flow"].status == "refused" for result in results)
    assert all(trusted_method(result) is None for result in results)


def test_events_without_order_are_no_spin() -> None:
    rng = np.random.default_rng(3)
    t = np.sort(rng.integers(0, 50_000, 3000))
    x, y = rng.integers(628, 652, 3000), rng.integers(348, 372, 3000)
    events = EventBatch.checked(t, x, y, rng.random(3000) < 0.5, width_px=1280, height_px=720)
    assert all(trusted_method(result) is None for result in spins(events, STILL))


def test_a_new_shot_knows_nothing_of_the_last() -> None:
    events = events_of("top, in place")
    ticks = [(packet, known_track(packet.end_us)) for packet in packets(events)]
    second = [(packet, of_shot(track, 1)) for packet, track in ticks[5:]]
    fresh = after_track(ticks[5:])
    for (_, _, _, one), (_, _, _, other) in zip(after_track(ticks[:5] + second)[5:], fresh, strict=True):
        for method in METHODS:
            a, b = one[method], other[method]
            assert a.reason == b.reason
            if a.vector_rps is not None:
                np.testing.assert_array_equal(a.vector_rps, b.vector_rps)


def test_the_window_forgets() -> None:
    events = events_of("side, logo at 45 degrees")
    short = spins(events, STILL, window_us=20_000)[-1]
    whole = spins(events, STILL)[-1]
    for method in METHODS:
        assert 0 < short[method].events < 0.6 * whole[method].events
    assert errors(short["normal_flow"], np.array([0.0, 0.0, 50.0]))[1] < 2


def digest() -> list[float]:
    """A few numbers of every stage after the track on 5 ms of a ball."""
    events = events_of("side, logo at 45 degrees").between(20_000, 25_000)
    cut = [packet for packet in packets(events, 2500) if len(packet.events)]
    numbers: list[float] = []
    for seen, rate, flow, spin in after_track([(packet, known_track(packet.end_us)) for packet in cut]):
        numbers += [len(seen.events), seen.points_m.sum(), rate.ema_hz.sum(), flow.vx_px_s.sum()]
        numbers += [flow.normal_speed_px_s.sum()]
        for estimate in spin.values():
            numbers += [] if estimate.vector_rps is None else estimate.vector_rps.tolist()
    return [float(number) for number in numbers]


@pytest.mark.nojit
def test_without_the_jit_everything_is_the_same_and_nothing_overflows() -> None:
    code = (
        "import json, sys, warnings\n"
        "from tests.pipeline.stages.test_spin import digest\n"
        "warnings.simplefilter('error')\n"
        "sys.stdout.write(json.dumps(digest()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    plain, compiled = json.loads(done.stdout), digest()
    assert len(plain) == len(compiled) > 15
    np.testing.assert_allclose(plain, compiled, rtol=1e-6)
