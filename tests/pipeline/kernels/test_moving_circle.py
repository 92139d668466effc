"""The kernels of moving circles equal their slow twins, and the fit finds moving circles under noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import moving_circle, outline, velocity_vote
from spinscope.pipeline.kernels.moving_circle import HALF_AHEAD, OF_BRIGHT, OF_DARK, WHOLE
from spinscope.pipeline.kernels.take_events import take_others
from tests.columns import read_only
from tests.reference import hough as reference

ROUND = np.zeros(2)
FREE = np.full(5, 1e9)
Floats = NDArray[np.float64]


def on_ring(
    ring: Floats, count: int, rng: np.random.Generator, scatter_px: float = 0.1, ahead_only: bool = False
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Events on a moving circle during the last 3 ms: seconds, columns, rows, ON ahead and OFF behind."""
    tau = np.sort(-3e-3 * rng.random(count))
    heading = math.atan2(ring[3], ring[2])
    spread = math.pi / 2 if ahead_only else math.pi
    angle = heading + rng.uniform(-spread, spread, count)
    distance = ring[4] + scatter_px * rng.standard_normal(count)
    x = ring[0] + ring[2] * tau + distance * np.cos(angle)
    y = ring[1] + ring[3] * tau + distance * np.sin(angle)
    return tau, x, y, np.cos(angle - heading) > 0


def scene(seed: int, clutter: int = 40) -> tuple[Floats, Floats, Floats, Floats, NDArray[np.bool_]]:
    """A random ring, with events on it and anywhere."""
    rng = np.random.default_rng(seed)
    speed, heading = rng.uniform(500, 15000), rng.uniform(0, 2 * math.pi)
    ring = np.array(
        [
            rng.uniform(0, 60),
            rng.uniform(0, 40),
            speed * math.cos(heading),
            speed * math.sin(heading),
            rng.uniform(5, 30),
        ]
    )
    tau, x, y, on = on_ring(ring, 150, rng)
    noise = rng.random((3, clutter)) * np.array([[-3e-3], [100.0], [80.0]]) - np.array([[0.0], [20.0], [20.0]])
    order = np.argsort(np.concatenate([tau, noise[0]]))
    columns = [np.concatenate([a, b])[order] for a, b in zip((tau, x, y), noise, strict=True)]
    return ring, *columns, np.concatenate([on, rng.random(clutter) < 0.5])[order]


@given(seed=st.integers(0, 2**32 - 1), oval=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)))
def test_measures_equal_the_twins(seed: int, oval: tuple[float, float]) -> None:
    ring, tau, x, y, on = scene(seed)
    bent = np.array(oval)
    assert np.allclose(
        moving_circle.residuals(ring, bent, tau, x, y), reference.residuals(ring, bent, tau, x, y), atol=1e-9
    )
    args = (ring, bent, tau, x, y, on, 60, 40)
    assert np.allclose(outline.support(*args), reference.support(*args, 1.2, 0.2 * ring[4], 32))
    for bright, events in ((True, slice(None)), (False, slice(None)), (True, slice(20))):
        seen = (*(column[events] for column in (tau, x, y, on)), bright)
        assert np.isclose(
            outline.distance_behind(ring, bent, *seen),
            reference.distance_behind(ring, bent, *seen, least=12),
            atol=1e-9,
            equal_nan=True,
        )
    votes = np.zeros((2, 9, 9))
    velocity_vote.vote_velocity(votes, ring, tau, x, y, on, 700.0, 2.5)
    for signed in (True, False):
        off = np.abs(
            votes[velocity_vote.SIGNED if signed else velocity_vote.UNSIGNED]
            - reference.vote_velocity(4, ring, tau, x, y, on, 700.0, 2.5, signed)
        )
        # In single precision an event that the motion passes at right angles may change sides.
        assert np.mean(off < 1e-3) > 0.9 and off.max() < (2.001 if signed else 1e-3)
    t_us = np.round(tau * 1e6).astype(np.int64)
    whole = np.clip(np.round(x), 0, 999).astype(np.uint16), np.clip(np.round(y), 0, 999).astype(np.uint16)
    assert outline.disc_events(ring, (t_us, *whole, on), 0) == reference.disc_events(
        ring, t_us * 1e-6, *(column.astype(np.float64) for column in whole), 1.2
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    gate=st.floats(0.5, 12),
    most=st.integers(1, 200),
    part=st.sampled_from((WHOLE, HALF_AHEAD, OF_BRIGHT, OF_DARK)),
    margin=st.floats(0, 20),
)
def test_choices_of_events_equal_the_twins(seed: int, gate: float, most: int, part: int, margin: float) -> None:
    ring, tau, x, y, on = scene(seed)
    t_us = np.rint(tau * 1e6).astype(np.int64) + 7_000_000
    columns = [np.clip(np.rint(column), 0, 1000).astype(np.uint16) for column in (x, y)]
    exact = [(t_us - 7_000_000) * 1e-6, *(column.astype(np.float64) for column in columns)]
    events = read_only(t_us, *columns, on)
    near = moving_circle.near_outline(ring, events, 7_000_000, gate, most, part)
    assert np.array_equal(near, reference.near_outline(ring, *exact, on, gate, most, part))
    rings, margins = np.array([ring, ring + np.array([40, -30, 500, 0, -2])]), np.array([margin, 0.5 * margin])
    for count in (1, 2):
        inside = moving_circle.inside_circles(rings[:count], events, 7_000_000, margins[:count])
        assert np.array_equal(inside, reference.inside_circles(rings[:count], *exact, margins[:count]))
        others = take_others(inside, events)
        assert all(np.array_equal(a, np.delete(b, inside)) for a, b in zip(others, events, strict=True))


@given(
    seed=st.integers(0, 2**32 - 1),
    rounds=st.integers(1, 9),
    held=st.lists(st.sampled_from([0.0, 0.5, 1e9]), min_size=5, max_size=5),
)
def test_fit_equals_the_twin(seed: int, rounds: int, held: list[float]) -> None:
    ring, tau, x, y, _ = scene(seed)
    start = ring + np.array([0.5, -0.4, 150.0, -100.0, 0.3])
    prior = np.array(held) * np.array([1, 1, 1000, 1000, 1])
    args = (start, prior, ROUND, tau, x, y, 2.5, 0.6, rounds)
    fitted, _, _, _ = moving_circle.fit_circle(*args)
    assert np.allclose(fitted, reference.fit_circle(*args), atol=np.array([1e-4, 1e-4, 0.1, 0.1, 1e-4]), rtol=0)


@given(seed=st.integers(0, 2**32 - 1), ahead_only=st.booleans())
def test_fit_finds_the_ring_and_knows_how_well(seed: int, ahead_only: bool) -> None:
    rng = np.random.default_rng(seed)
    heading, speed = rng.uniform(0, 2 * math.pi), rng.uniform(1500, 16000)
    ring = np.array([300.0, 200.0, speed * math.cos(heading), speed * math.sin(heading), rng.uniform(7, 40)])
    tau, x, y, _ = on_ring(ring, 300, rng, ahead_only=ahead_only)
    x[::10] += rng.uniform(-10, 10, x[::10].size)  # a tenth are the logo's, or noise
    start = ring + np.array([1.0, -1.0, 300.0, -300.0, 0.8])
    fitted, covariance, scatter, weight = moving_circle.fit_circle(start, FREE, ROUND, tau, x, y, 3.0, 0.6, 12)
    off = fitted - ring
    assert off @ np.linalg.solve(covariance, off) < 45  # five degrees of freedom: 1e-8 by chance
    assert np.hypot(*off[:2]) < 0.3
    assert 0.05 < scatter < 0.2
    assert 150 < weight < 300


def test_a_circle_at_rest_is_fitted_with_its_velocity_held() -> None:
    rng = np.random.default_rng(1)
    tau, x, y, _ = on_ring(np.array([20.0, 30.0, 1e-9, 0.0, 10.0]), 200, rng)
    start = np.array([20.5, 29.5, 0.0, 0.0, 9.5])
    fitted, *_ = moving_circle.fit_circle(start, np.array([1e9, 1e9, 0, 0, 1e9]), ROUND, tau, x, y, 2.0, 0.6, 9)
    assert np.allclose(fitted, [20, 30, 0, 0, 10], atol=0.05)


@pytest.mark.parametrize("bright", [True, False])
@given(seed=st.integers(0, 2**32 - 1))
def test_velocity_votes_peak_at_the_velocity(bright: bool, seed: int) -> None:
    """The sign of the peak says whether the ball is brighter than its background."""
    rng = np.random.default_rng(seed)
    step, m = 1000.0, 8
    i, j = (int(n) for n in rng.integers(-5, 6, 2))
    if i == 0 and j == 0:
        return
    ring = np.array([100.0, 100.0, i * step, j * step, 18.0])
    tau, x, y, on = on_ring(ring, 200, rng)
    both = np.zeros((2, 2 * m + 1, 2 * m + 1))
    at_rest = ring * np.array([1, 1, 0, 0, 1])
    velocity_vote.vote_velocity(both, at_rest, tau, x, y, on if bright else ~on, step, 2.0)
    votes = both[velocity_vote.SIGNED]
    best = np.unravel_index(int(np.argmax(np.abs(votes))), votes.shape)
    assert best == (m + j, m + i)
    assert (votes[best] > 0) == bright


def test_an_oval_outline_is_known() -> None:
    """An ellipse with semi-axes 1 +- 4 % along x and y is fitted as what it is."""
    angle = np.linspace(0, 2 * math.pi, 240, endpoint=False)
    x, y = 50 + 20.8 * np.cos(angle), 40 + 19.2 * np.sin(angle)
    args: tuple[Any, ...] = (np.array([50.3, 39.8, 0, 0, 19.5]), np.array([1e9, 1e9, 0, 0, 1e9]))
    fitted, _, scatter, _ = moving_circle.fit_circle(*args, np.array([0.04, 0.0]), np.zeros(240), x, y, 3.0, 0.6, 12)
    assert np.allclose(fitted, [50, 40, 0, 0, 20], atol=0.05)
    assert scatter < 0.02


def test_boxes_hold_their_border() -> None:
    x, y = np.array([0, 5, 10, 11, 5], np.uint16), np.array([5, 5, 10, 5, 11], np.uint16)
    events = read_only(np.arange(5), x, y, np.ones(5, np.bool_))
    assert moving_circle.in_box(events, (0.0, 10.0, 0.0, 10.0)).tolist() == [0, 1, 2]


@given(seed=st.integers(0, 2**32 - 1), off_px=st.floats(-6.0, 6.0), gate_px=st.floats(1.0, 9.0))
def test_a_measured_outline_is_the_fit_and_its_evidence(seed: int, off_px: float, gate_px: float) -> None:
    """Also where the fit moves the outline out of the events that were looked at for it."""
    ring, tau, x, y, on = scene(seed)
    inside = (x >= 0) & (y >= 0)
    columns = (tau * 1e6).astype(np.int64), np.round(x).astype(np.uint16), np.round(y).astype(np.uint16)
    events = read_only(*(column[inside] for column in (*columns, on)))
    expected, optics = ring.copy(), (1646.0, 40.0, 30.0)
    expected[[0, 4]] += off_px, -off_px / 2
    oval = outline.ellipticity_at(expected[0], expected[1], optics)
    found = outline.measured_outline(expected, FREE, optics, events, 0, gate_px, HALF_AHEAD, 100, 80)
    fitted = outline.fit_outline(expected, FREE, oval, events, 0, gate_px, HALF_AHEAD)
    for one, other in zip(found[:3], fitted, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    if np.isfinite(fitted[0]).all():
        support, behind_px = outline.evidence(fitted[0], oval, events, 0, 100, 80)
        assert np.array_equal(found[3], support) and np.array_equal(found[4], behind_px, equal_nan=True)


def test_an_outline_off_the_axis_is_an_ellipse_along_the_radius() -> None:
    """A sphere's outline: semi-axes as 1 to cos(theta), theta = 20 degrees off the axis, towards the diagonal."""
    off_px = 1000.0 * math.tan(math.radians(20.0)) / math.sqrt(2.0)
    cosine, sine = outline.ellipticity_at(50.0 + off_px, 40.0 + off_px, (1000.0, 50.0, 40.0))
    assert abs(cosine) < 1e-12
    assert np.isclose((1 + sine) / (1 - sine), 1 / math.cos(math.radians(20.0)))


@pytest.mark.parametrize("bright", [True, False])
def test_a_moving_ring_is_measured_from_a_place_alone(bright: bool) -> None:
    """The velocity by vote, then the fit, its support, and NaN with nothing there."""
    ring = np.array([60.0, 50.0, 4000.0, -2500.0, 16.0])
    tau, x, y, on = on_ring(ring, 600, np.random.default_rng(3))
    columns = np.round(tau * 1e6).astype(np.int64), np.round(x).astype(np.uint16), np.round(y).astype(np.uint16)
    recent = tau > -1.5e-3
    events = read_only(*(column[recent] for column in columns), (on if bright else ~on)[recent])
    circles, gate = velocity_vote.find_moving_circle(60.8, 49.0, 15.5, events, 0, 1.5e-3, 12_000.0)
    start = circles[velocity_vote.SIGNED]
    assert np.hypot(*(start - ring)[2:4]) < 1500
    fitted, covariance, scatter = outline.fit_outline(start, FREE, ROUND, events, 0, 1.5 * gate, HALF_AHEAD)
    found, behind_px = outline.evidence(fitted, ROUND, events, 0, 1280, 720)
    assert np.allclose(fitted[:2], ring[:2], atol=0.3) and abs(fitted[4] - 16) < 0.2
    assert np.hypot(*(fitted - ring)[2:4]) < 300 and scatter < 0.6 and np.all(np.diag(covariance) > 0)
    assert min(found[3], found[4]) > 0.8 and np.allclose(found[1:3], [bright, not bright], atol=0.03)
    assert abs(behind_px) < 0.2, "the outline is as thin as it is round"
    nothing = tuple(column[:5] for column in events)
    assert np.isnan(velocity_vote.find_moving_circle(60.8, 49.0, 15.5, nothing, 0, 1.5e-3, 12_000.0)[0]).all()
    assert np.isnan(outline.fit_outline(start, FREE, ROUND, nothing, 0, 3.0, HALF_AHEAD)[0][0])


def test_polarity_does_not_matter_to_an_unsigned_vote() -> None:
    """Ground brighter than the ball on one side and darker on the other: signed votes cancel, unsigned ones do not."""
    ring = np.array([60.0, 50.0, 4000.0, -2500.0, 16.0])
    tau, x, y, on = on_ring(ring, 600, np.random.default_rng(4))
    recent = tau > -1.5e-3
    left = x - (ring[0] + ring[2] * tau) < 0.6 * (y - (ring[1] + ring[3] * tau))
    columns = np.round(tau * 1e6).astype(np.int64), np.round(x).astype(np.uint16), np.round(y).astype(np.uint16)
    events = read_only(*(column[recent] for column in columns), (on ^ left)[recent])
    circles, _ = velocity_vote.find_moving_circle(60.8, 49.0, 15.5, events, 0, 1.5e-3, 12_000.0)
    start = circles[velocity_vote.UNSIGNED]
    assert np.hypot(*(start - ring)[2:4]) < 1500
