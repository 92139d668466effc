"""Each refusal of rate, triplet and normal flow, just before and just after it sets in."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.rate import shortest_period
from spinscope.pipeline.results import Packet, SpinEstimate
from spinscope.pipeline.spin import normal_flow
from spinscope.pipeline.spin.normal_flow import NormalFlowSpin
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.spin.triplet import TripletSpin
from spinscope.pipeline.stages import logo, rate
from spinscope.pipeline.stages.filter import FilterResult
from spinscope.pipeline.stages.flow import FlowEvents, FlowResult
from spinscope.pipeline.stages.logo import LogoResult
from spinscope.pipeline.stages.rate import RateParameters, RateResult
from spinscope.pipeline.stages.rate_period import PatternPeriod
from tests.spinning_ball import CONTEXT, known_ball, packets, spinning_ball

NO_PERIOD = PatternPeriod.nothing("nothing yet")
SILENT = RateResult(  # type: ignore[arg-type]
    *(np.empty(0),) * 4, 200.0, np.empty(0), None, None, "nothing yet", np.empty(0), np.empty(0), np.nan, "nothing yet"
)
TAU = 2 * math.pi


def seen(packet: Packet) -> LogoResult:
    """The logo's events of a tick of a ball that stays."""
    parameters = logo.LogoParameters()
    state, filtered = logo.start(parameters, CONTEXT), FilterResult(packet.events, packet.events, packet.events)
    return logo.step(parameters, state, packet, filtered, known_ball(packet.end_us))


def in_the_middle(t_us: np.ndarray) -> EventBatch:
    """Events at these times in the middle of the ball."""
    middle = np.full(t_us.size, 640)
    return EventBatch.checked(t_us, middle, middle - 280, middle > 0, width_px=1280, height_px=720)


# Rate


@pytest.mark.parametrize(("shortest", "period"), [(1, 6), (6, 6), (7, 20), (20, 20), (21, 0)])
def test_periods_below_the_lower_bound_are_not_taken(shortest: int, period: int) -> None:
    correlation = np.zeros(40)
    correlation[[6, 20]] = 0.95, 0.9
    assert shortest_period(correlation, shortest, 0.8) == period


@pytest.mark.parametrize(("peak", "period"), [(0.81, 6), (0.79, 20)])
def test_a_period_repeats_nearly_as_well_as_the_best_of_its_multiples(peak: float, period: int) -> None:
    correlation = np.zeros(40)
    correlation[[6, 20]] = peak, 1.0
    assert shortest_period(correlation, 1, 0.8) == period


@pytest.mark.parametrize(("max_spin_rps", "lag"), [(150.0, 10), (80.0, 20), (40.0, 40)])
def test_the_lower_bound_is_four_fifths_of_the_fastest_rotation(
    monkeypatch: pytest.MonkeyPatch, max_spin_rps: float, lag: int
) -> None:
    asked = []
    monkeypatch.setattr(rate, "shortest_period", lambda correlation, shortest, share: asked.append(shortest) or 0)
    rate._with_period(
        RateParameters(), max_spin_rps, np.arange(200) * 500, np.random.default_rng(0).random(200), NO_PERIOD
    )
    assert asked == [pytest.approx(lag, abs=1)] and asked[0] <= lag


@pytest.mark.parametrize(("peak", "repeats"), [(0.51, True), (0.49, False)])
def test_half_a_correlation_is_a_rhythm(monkeypatch: pytest.MonkeyPatch, peak: float, repeats: bool) -> None:
    correlation = np.zeros(150)
    correlation[40] = peak
    monkeypatch.setattr(rate, "autocorrelation", lambda signal, lags: correlation)
    waves = 1000.0 + 500.0 * np.cos(np.arange(200) * TAU / 40)
    result = rate._with_period(RateParameters(), 150.0, np.arange(200) * 500, waves, NO_PERIOD)
    assert (result.spin_rps is not None) == repeats
    assert result.low_pass_hz == (100.0 if repeats else 200.0)  # 2 / (40 bins of 500 us), or the parameter's
    assert repeats or result.reason == "the event rate does not repeat itself"


@pytest.mark.parametrize(("count", "reason"), [(99, "99 logo events, 100 are needed"), (100, "crossings")])
def test_the_rate_needs_a_hundred_events(count: int, reason: str) -> None:
    packet = Packet(0, 0, 50_000, in_the_middle(np.linspace(0, 49_000, count).astype(np.int64)))
    state = rate.start(RateParameters(), CONTEXT)
    assert reason in str(rate.step(RateParameters(), state, packet, known_ball(packet.end_us), seen(packet)).reason)


def test_the_first_bin_of_a_shot_lies_wholly_in_it() -> None:
    """A shot from 5 ms on with bins of 700 us: the bin that began at 4.9 ms is left out with its events."""
    t_us = np.arange(5000, 15_000, 50)
    group = RateParameters(bin_us=700)
    state = rate.start(group, CONTEXT)
    for packet in (
        Packet(1, 5000, 10_000, in_the_middle(t_us[:100])),
        Packet(2, 10_000, 15_000, in_the_middle(t_us[100:])),
    ):
        result = rate.step(group, state, packet, known_ball(packet.end_us), seen(packet))
    assert result.t_us[0] == 5600 and result.t_us[-1] == 14_000
    np.testing.assert_allclose(result.rate_hz, 14 / 700e-6)


def crossings(*intervals_ms: float) -> np.ndarray:
    return np.concatenate([[3000.0], 3000.0 + np.cumsum(intervals_ms) * 1000.0])


@pytest.mark.parametrize(
    ("intervals_ms", "repeats", "reason"),
    [
        ((), True, "1 falling crossings, two are needed"),
        ((20.0,), True, None),
        ((17.2, 22.8), True, None),  # 14 percent
        ((16.8, 23.2), True, "intervals of 20.0 ms spread by 3.2 ms"),
        ((20.0, 20.0), False, "does not repeat"),
        ((5.4, 5.4), True, None),  # 185 rps: within a quarter of 150
        ((5.3, 5.3), True, "189 rps is above"),
    ],
)
def test_crossings_make_a_rhythm_or_a_reason(
    intervals_ms: tuple[float, ...], repeats: bool, reason: str | None
) -> None:
    spin_rps, std_rps, said = rate._spin(crossings(*intervals_ms), repeats, RateParameters(), 150.0)
    assert (spin_rps is None) == (std_rps is None) == (said is not None) == (reason is not None)
    assert (reason or "") in (said or "")


def test_the_rates_stated_error_is_that_of_a_mean_interval() -> None:
    """1 sigma of the intervals, at least that of a bin, by the square root of their number; one alone is unsure."""
    for intervals_ms, spread_ms in (
        ((18.0, 22.0, 18.0, 22.0), 2.0),
        ((20.0,) * 4, 0.5 / math.sqrt(6)),
        ((20.0,), 0.075 * 20.0),
        ((2.0,), 0.5 / math.sqrt(6)),
    ):
        spin_rps, std_rps, _ = rate._spin(crossings(*intervals_ms), True, RateParameters(), 1000.0)
        mean_ms = np.mean(intervals_ms)
        assert spin_rps == pytest.approx(1e3 / mean_ms)
        assert std_rps == pytest.approx(1e3 * spread_ms / mean_ms**2 / math.sqrt(len(intervals_ms)))


# Triplet


def flow_of(slices: tuple[int, ...], end_us: tuple[int, ...], seed: int = 0) -> FlowResult:
    """Flow of so many events a slice, each slice ending with an event at this time."""
    rng = np.random.default_rng(seed)
    count = sum(slices)
    normals = rng.normal(size=(count, 3)) - [0, 0, 3]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    t_us, points_m = np.repeat(np.array(end_us, np.int64), slices), np.array([0, 0, 2.0]) + 0.02 * normals
    events = FlowEvents(
        t_us, np.zeros(count), np.zeros(count), np.ones(count, np.bool_), points_m, normals, *np.zeros((3, count))
    )
    flow_px_s = rng.normal(3000, 100, count), rng.normal(-1000, 100, count)
    no_normal_flow = FlowEvents.empty(), np.empty((0, 2)), np.empty(0), np.empty(0, np.bool_)
    return FlowResult(2000, 1e5, 17.0, events, *flow_px_s, np.repeat(np.arange(len(slices)), slices), *no_normal_flow)


NO_FLOW = flow_of((), ())


def test_triplets_window_moves_on_without_new_flow() -> None:
    """Slices ended at 2 and 4 ms are in a window of 10 ms up to 12 and 14 ms, also where nothing follows."""
    method = TripletSpin(SpinParameters(window_us=10_000), CONTEXT)
    assert method.estimate(5000, flow_of((7, 9), (2000, 4000)), SILENT).events == 16
    assert method.estimate(12_000, NO_FLOW, SILENT).events == 16
    assert method.estimate(12_001, NO_FLOW, SILENT).events == 9
    assert method.estimate(14_000, NO_FLOW, SILENT).status == "ok"
    assert method.estimate(14_001, NO_FLOW, SILENT).reason == "no flow"
    assert method.estimate(20_000, flow_of((5,), (19_000,)), SILENT).events == 5


def bias(estimate: SpinEstimate) -> np.ndarray:
    """Axes 15 degrees off, magnitudes a third too small."""
    spin = estimate.vector_rps
    assert spin is not None
    return np.radians(15.0) ** 2 / 2 * (spin @ spin) * np.eye(3) + 0.3**2 * np.outer(spin, spin)


@pytest.mark.parametrize("solve", ["paper", "least_squares"])
def test_triplets_stated_error_is_its_slices_spread_and_what_their_flow_lacks(solve: str) -> None:
    """By the law of the mean of slices; a single slice is as uncertain as its spin is long."""
    method = TripletSpin(SpinParameters(triplet_solve=solve), CONTEXT)
    one = method.estimate(5000, flow_of((30,), (2000,)), SILENT)
    np.testing.assert_allclose(one.covariance_rps2, np.eye(3) * (one.vector_rps @ one.vector_rps) + bias(one))
    many = TripletSpin(SpinParameters(triplet_solve=solve), CONTEXT)
    slices = [
        TripletSpin(SpinParameters(triplet_solve=solve), CONTEXT).estimate(5000, flow_of((30,), (2000,), k), SILENT)
        for k in range(12)
    ]
    for k in range(12):
        estimate = many.estimate(5000 + k, flow_of((30,), (2000,), k), SILENT)
    spread = np.cov(np.array([one.vector_rps for one in slices]).T) / 12
    own = estimate.covariance_rps2 - bias(estimate)
    if solve == "paper":
        seen = np.mean([square / count for square, count in zip(many.squares, many.counts, strict=True)], axis=0)
        lost = np.linalg.solve(seen + 1e-3 * np.eye(3), estimate.vector_rps) - estimate.vector_rps
        np.testing.assert_allclose(own, spread + np.outer(lost, lost), rtol=1e-9, atol=1e-9)
    else:
        assert np.trace(own) == pytest.approx(np.trace(spread), rel=0.5)


def test_the_rates_magnitude_replaces_the_flows_with_its_error() -> None:
    flow = flow_of((20, 20, 20), (1000, 2000, 3000))
    plain = TripletSpin(SpinParameters(magnitude_from="flow"), CONTEXT).estimate(5000, flow, SILENT)
    known = dataclasses.replace(SILENT, spin_rps=50.0, spin_std_rps=0.7)
    estimate = TripletSpin(SpinParameters(), CONTEXT).estimate(5000, flow, known)
    np.testing.assert_allclose(estimate.axis, plain.axis)
    assert estimate.magnitude_rps == pytest.approx(50.0) and estimate.magnitude_std_rps == pytest.approx(0.7)
    assert estimate.axis_std_deg == pytest.approx(plain.axis_std_deg)


@pytest.mark.parametrize(("spread_deg", "status"), [(8.0, "ok"), (3.0, "refused")])
def test_the_full_rank_solve_needs_directions_apart(spread_deg: float, status: str) -> None:
    """All events on a circle around one direction: what lies along it is seen with sin^2 of the circle's radius."""
    flow = flow_of((40,), (2000,))
    angle = np.linspace(0, TAU, 40, endpoint=False)
    radius = math.radians(spread_deg)
    normals = np.stack(
        [math.sin(radius) * np.cos(angle), math.sin(radius) * np.sin(angle), np.full(40, -math.cos(radius))], axis=1
    )
    flow = dataclasses.replace(flow, events=dataclasses.replace(flow.events, normals=normals))
    method = TripletSpin(SpinParameters(triplet_solve="least_squares"), CONTEXT)
    assert method.estimate(5000, flow, SILENT).status == status


# Normal flow


def seen_at(t_us: np.ndarray, **columns: np.ndarray) -> Any:
    """Logo events at these times, in the middle of the ball and seen from the camera, but for the columns given."""
    towards = np.tile([0.0, 0.0, -1.0], (t_us.size, 1))
    deep = columns.get("deep", np.ones(t_us.size, np.bool_))
    places = columns.get("normals", towards), columns.get("sights", towards)
    return normal_flow._Seen(t_us.astype(np.int64), np.zeros(t_us.size, np.bool_), *places, deep)


def method_with(events: int = 30, deep: int = 20, planes: int = 12) -> NormalFlowSpin:
    """Normal flow in a shot with so many events, of which so many lie deep, and so many planes."""
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    method.seen = seen_at(np.arange(events), deep=np.arange(events) < deep)
    method.planes = normal_flow._Planes(
        np.arange(planes), np.zeros((planes, 3)), np.ones(planes), np.ones(planes, bool)
    )
    method._add = lambda logo, flow: None  # type: ignore[method-assign]
    method._fit = lambda: None  # type: ignore[method-assign]
    return method


@pytest.mark.parametrize(
    ("counts", "reason"),
    [
        ({}, "the normal flow agrees on no spin"),
        ({"events": 29}, "hardly seen: 29 events, 30 are needed"),
        ({"deep": 19}, "hardly seen: 19 events off the rim, 20 are needed"),
        ({"planes": 11}, "11 events with normal flow, 12 are needed"),
    ],
)
def test_normal_flow_needs_events_deep_ones_and_planes(counts: dict[str, int], reason: str) -> None:
    estimate = method_with(**counts).estimate(5000, None, None, SILENT)  # type: ignore[arg-type]
    assert estimate.status == "refused" and reason in str(estimate.reason)
    assert estimate.events == counts.get("events", 30)


def test_events_count_as_deep_two_pixels_inside_the_mask() -> None:
    (packet,) = list(packets(spinning_ball(np.array([40.0, 0.0, 0.0]), duration_us=5000)))[:1]
    logo_result = seen(packet)
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    method._add(logo_result, NO_FLOW)
    own = ~logo_result.of_outline
    distance_px = np.hypot(logo_result.x_px, logo_result.y_px)[own]
    np.testing.assert_array_equal(method.seen.deep, distance_px < logo_result.radius_px - logo_result.pad_px - 2.0)
    assert method.seen.deep.any() and not method.seen.deep.all()


def test_what_may_be_the_outline_is_no_evidence_of_a_spin() -> None:
    events = in_the_middle(np.arange(5000, 10_000, 100))
    logo_result = seen(Packet(1, 5000, 10_000, events))
    of_outline = np.arange(len(logo_result.events)) % 3 == 0
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    method._add(dataclasses.replace(logo_result, of_outline=of_outline), NO_FLOW)
    assert method.seen.t_us.tolist() == logo_result.events.t_us[~of_outline].tolist()


def fit(**changes: Any) -> Any:
    """A fit beyond doubt: 40 rps by constraints in all directions."""
    rng = np.random.default_rng(4)
    rows, spin = rng.normal(size=(60, 3)), TAU * np.array([24.0, 0.0, -32.0])
    good = normal_flow._Fit(
        spin, np.arange(60), rows, rows @ spin, np.ones(60), rows.T @ rows, scale=1.0, share=0.9, overlap=2.0
    )
    return dataclasses.replace(good, **changes)


def judge(good: Any, covariance_rps2: np.ndarray | None, rhythm: RateResult = SILENT, **values: Any) -> SpinEstimate:
    method = NormalFlowSpin(SpinParameters(**values), CONTEXT)
    covariance = None if covariance_rps2 is None else covariance_rps2 * TAU**2
    method._covariance = lambda found: covariance  # type: ignore[method-assign]
    method.seen = seen_at(np.array([0, 50_000]))
    return method._judged(good, rhythm)


def axis_known_to(std_deg: float) -> np.ndarray:
    along = np.outer([0.6, 0.0, -0.8], [0.6, 0.0, -0.8])
    return along + (np.eye(3) - along) * 0.5 * (math.radians(std_deg) * 40.0) ** 2


@pytest.mark.parametrize(
    ("good", "bad", "reason"),
    [
        ({"share": 0.41}, {"share": 0.39}, "only 39 % of the events move like one turning ball"),
        ({"scale": 1.59}, {"scale": 1.61}, "scatters 1.6 times as much"),
    ],
)
def test_a_fit_that_does_not_move_like_one_ball_is_doubted(
    good: dict[str, float], bad: dict[str, float], reason: str
) -> None:
    assert judge(fit(**good), np.eye(3)).status == "ok"
    assert reason in str(judge(fit(**bad), np.eye(3)).reason)


def test_what_the_logo_leaves_open_is_refused() -> None:
    assert judge(fit(), axis_known_to(24.9)).status == "ok"
    assert "leaves the axis open by 25 degrees" in str(judge(fit(), axis_known_to(25.4)).reason)
    assert "leaves a part of the spin open" in str(judge(fit(), None).reason)
    assert judge(fit(), np.eye(3), max_spin_rps=41.0).status == "ok"
    assert "above spin.max_spin_rps = 39 rps: 40 rps" in str(judge(fit(), np.eye(3), max_spin_rps=39.0).reason)


@pytest.mark.parametrize(("least", "is_open"), [(1.1e-4, False), (0.9e-4, True)])
def test_a_spin_is_open_where_one_direction_weighs_a_ten_thousandth_of_another(least: float, is_open: bool) -> None:
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    normals = 0.1 * np.random.default_rng(0).normal(size=(60, 3)) - [0.0, 0.0, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    method.seen, method.tracks = seen_at(np.arange(60) * 100, normals=normals), np.array([[17.0, 0.2, 0.2, 50.0]])
    covariance = method._covariance(fit(matrix=np.diag([least, 0.5, 1.0])))
    assert (covariance is None) == is_open


@pytest.mark.parametrize(("sigmas", "taken"), [(2.9, True), (3.1, False), (-2.9, True), (-3.1, False)])
def test_a_rate_within_three_sigma_sharpens_the_magnitude(sigmas: float, taken: bool) -> None:
    """Of the flow's error along the axis and the rate's own."""
    rate_rps = 40.0 + sigmas * math.sqrt(1.5**2 + 0.8**2)
    rhythm = dataclasses.replace(SILENT, spin_rps=rate_rps, spin_std_rps=0.8)
    estimate = judge(fit(), np.eye(3) * 1.5**2, rhythm)
    if not taken:
        assert estimate.magnitude_rps == pytest.approx(40.0) and estimate.magnitude_std_rps == pytest.approx(1.5)
        return
    weights = 1 / 1.5**2, 1 / 0.8**2
    assert estimate.magnitude_rps == pytest.approx(np.average([40.0, rate_rps], weights=weights), rel=1e-6)
    assert estimate.magnitude_std_rps == pytest.approx(1 / math.sqrt(sum(weights)))
    assert judge(fit(), np.eye(3) * 1.5**2, rhythm, magnitude_from="flow").magnitude_rps == pytest.approx(40.0)


@pytest.mark.parametrize(("across", "counts"), [(0.55, True), (0.45, False)])
def test_the_turning_of_the_line_of_sight_is_added_unless_it_looks_along_the_axis(across: float, counts: bool) -> None:
    """Two degrees about the axis in 50 ms are 0.11 rps."""
    axis = np.array([0.6, 0.0, -0.8])
    one, other = np.array([0.8, 0.0, 0.6]), np.array([0.0, -1.0, 0.0])
    turned = math.radians(2.0)
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    sights = [
        across * (math.cos(a) * one + math.sin(a) * np.cross(axis, one)) + math.sqrt(1 - across**2) * axis
        for a in (0.0, 0.3, turned)
    ]
    method.seen = seen_at(np.array([0, 20_000, 50_000]), sights=np.array(sights))
    assert abs(other @ np.cross(axis, one)) > 0.9
    rhythm = dataclasses.replace(SILENT, spin_rps=40.0, spin_std_rps=1e-9)
    spin_rps, _ = method._with_rate(40.0 * axis, np.eye(3) * 1e4, rhythm)
    added_rps = math.degrees(turned) / 360.0 / 50e-3 if counts else 0.0
    assert np.linalg.norm(spin_rps) == pytest.approx(40.0 + added_rps, abs=0.002)


def test_normal_flow_forgets_events_and_planes_before_its_window() -> None:
    method = method_with()
    method.seen = seen_at(np.arange(40) * 500)
    t_us = np.tile(np.arange(10, dtype=np.int64) * 1000, 2)  # of the ball's frame and of the image
    method.planes = normal_flow._Planes(t_us, np.zeros((20, 3)), np.ones(20), np.arange(20) >= 10)
    method._forget(5000)
    assert method.seen.t_us.tolist() == list(range(5000, 20_000, 500))
    assert method.planes.t_us.tolist() == [5000, 6000, 7000, 8000, 9000] * 2
    assert method.planes.in_image.sum() == 5


def covariance_of(found: Any, position_std_px: float = 0.2, radius_std_px: float = 0.2) -> np.ndarray:
    """What normal flow states of a fit on a ball of 17 px whose place is known so well, (rad/s)^2."""
    rng = np.random.default_rng(6)
    method = NormalFlowSpin(SpinParameters(), CONTEXT)
    method.tracks = np.array([[17.0, position_std_px, radius_std_px, 50.0]])
    normals = rng.normal(size=(60, 3)) - [0, 0, 3]
    method.seen = seen_at(np.arange(60) * 1000, normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))
    covariance = method._covariance(found)
    assert covariance is not None
    return covariance


def test_normal_flows_stated_error_has_all_its_parts() -> None:
    """Of constraints without scatter: those of the constraints, of the ball's place, and of bent strokes."""
    least = covariance_of(fit())
    inverse = np.linalg.inv(fit().matrix)
    np.testing.assert_allclose(covariance_of(fit(overlap=5.0)) - least, 3.0 * inverse, rtol=1e-9)
    np.testing.assert_allclose(covariance_of(fit(scale=0.5)), least)
    np.testing.assert_allclose(covariance_of(fit(scale=1.5)), 2.25 * least)
    np.testing.assert_allclose(covariance_of(fit(), 0.1, 0.05), least, err_msg="no place is known better than 0.2 px")
    place, size = covariance_of(fit(), 0.4) - least, covariance_of(fit(), 0.2, 0.4) - least
    assert np.trace(place) > 0.1 and np.trace(size) > 0.1
    np.testing.assert_allclose(covariance_of(fit(), 0.6) - least, place * (0.36 - 0.04) / (0.16 - 0.04), rtol=1e-9)
    bent = least - 2.0 * inverse - 0.04 / (0.16 - 0.04) * (place + size)
    assert np.linalg.eigvalsh(bent).min() > -1e-9 and np.trace(bent) > 0.01


def test_residuals_that_hang_together_count_by_the_radian_of_turning() -> None:
    """The same residuals state more when all of a radian's have one sign."""
    rows = np.tile(np.eye(3), (20, 1))
    found = fit(rows=rows, speeds=rows @ fit().spin, matrix=rows.T @ rows)
    radian = np.floor(np.arange(60) * 1000 * np.linalg.norm(found.spin) * 1e-6).astype(int)
    together, mixed = np.where(radian % 2 == 0, 1.0, -1.0), np.where(np.arange(60) // 3 % 2 == 0, 1.0, -1.0)
    least = np.trace(covariance_of(found))
    scattered = [
        np.trace(covariance_of(dataclasses.replace(found, speeds=found.speeds + 100.0 * signs))) - least
        for signs in (together, mixed)
    ]
    assert scattered[0] > 2.0 * scattered[1]
    sums = np.array([100.0 / 20.0 * together[radian == one] @ rows[radian == one] for one in np.unique(radian)])
    assert scattered[0] == pytest.approx((sums**2).sum() * len(sums) / (len(sums) - 1), rel=0.2)
