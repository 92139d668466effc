"""What contrast states beyond its events' noise (polarities, near rivals, fast flight), and its likelihood."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.spin.contrast import estimate as contrast
from spinscope.pipeline.spin.contrast import search
from spinscope.pipeline.spin.contrast.estimate import estimate_spin, follow_spin
from spinscope.pipeline.spin.contrast.events import (
    LOG_ODDS_PER_SIGMA,
    UNEXPLAINED,
    BallUncertainty,
    ContrastResult,
    ContrastSettings,
    SphereEvents,
)
from tests.reference.contrast import dotted_ball
from tests.reference.rotation import turned

BALL = BallUncertainty(centre_std_px=0.2, radius_std_px=0.2)
SPIN = np.array([40.0, -25.0, 20.0])


def twist(speed_px_s: float, turns: float) -> np.ndarray:
    spin = 2 * math.pi * SPIN
    events = dotted_ball(SPIN)
    ball = replace(BALL, speed_px_s=speed_px_s)
    return search._twist(events, ball, spin, turns / float(np.linalg.norm(SPIN)))


def test_a_fast_flight_leaves_the_turn_about_the_logos_middle_open() -> None:
    events = dotted_ball(SPIN)
    middle = events.normals.mean(axis=1)
    middle /= np.linalg.norm(middle)
    spun_px_s = 2 * math.pi * float(np.linalg.norm(SPIN)) * float(events.radius_px.mean())
    off = 0.06 / 0.4 * 0.75 * 2 * math.pi * float(SPIN @ middle)  # three quarters of the edges' speed are the flight's
    np.testing.assert_allclose(twist(3 * spun_px_s, 0.4), off**2 * np.outer(middle, middle), rtol=1e-9)
    assert not twist(0.0, 0.4).any()


def test_the_logo_that_has_come_back_has_told_the_magnitude() -> None:
    axis = SPIN / np.linalg.norm(SPIN)
    assert axis @ twist(10_000.0, 0.4) @ axis > axis @ twist(10_000.0, 0.8) @ axis > 0.0
    once = twist(10_000.0, 1.0)
    assert axis @ once @ axis == pytest.approx(0.0, abs=1e-9) and np.trace(once) > 0.0


def share(events: SphereEvents, spin_rps: np.ndarray) -> float:
    return search.linked_share(search.without_strays(events), 2 * math.pi * spin_rps, ContrastSettings())


@pytest.mark.parametrize("spin_rps", [SPIN, 0.6 * SPIN])
def test_the_linked_share_is_that_of_the_pairs_that_coincide(spin_rps: np.ndarray) -> None:
    events = dotted_ball(SPIN, duration_s=0.02, events=200)
    points = turned(events.normals.T, -spin_rps, events.t_s)
    near = [sum(-0.0025 <= other - at < 0.0025 for other in events.t_s) for at in events.t_s]
    seen = [row for row in range(200) if near[row] >= 0.05 * max(near)]
    squares = [
        (events.t_s[i] - events.t_s[j]) ** 2
        for i, j in itertools.combinations(seen, 2)
        if events.polarity[i] == events.polarity[j] and math.acos(min(1.0, points[i] @ points[j])) < 0.08
    ]
    every = 2.0 * np.var(events.t_s[seen])
    assert share(events, spin_rps) == pytest.approx(math.sqrt(np.mean(squares) / every), rel=1e-9)


def test_visits_that_a_spin_brings_to_different_places_do_not_confirm_each_other() -> None:
    """A logo that shows for a fifth of a turn and, two turns later, again; with the spin, and with a slower one."""
    turn_s = 1.0 / float(np.linalg.norm(SPIN))
    events = dotted_ball(SPIN, duration_s=2.2 * turn_s, events=1200)
    visits = events.at(np.abs(events.t_s) > 0.9 * turn_s)
    assert share(visits, SPIN) > 0.8
    assert share(visits, 0.8 * SPIN) < 0.3


def short_visits(spin_rps: np.ndarray) -> SphereEvents:
    """Events of dots that show for short parts of some turns; each three times, 0.2 ms (1 sigma) sooner or later."""
    random = np.random.default_rng(3)
    axis = spin_rps / np.linalg.norm(spin_rps)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    nearer = np.cross(side, axis)
    nearer *= -np.sign(nearer[2])
    dots = side + 0.25 * random.standard_normal((12, 3))
    dots /= np.linalg.norm(dots, axis=1)[:, None]
    pick, t_s = random.integers(0, 12, 15_000), random.uniform(-0.0225, 0.0225, 15_000)
    normals = turned(dots[pick], spin_rps, t_s)
    seen = np.flatnonzero((normals[:, 2] < -0.3) & (normals @ nearer > 0.0) & (normals @ side > 0.75))
    rows = np.repeat(seen[:250], 3)
    late_s = t_s[rows] + 2e-4 * random.standard_normal(rows.size)
    order = np.argsort(late_s, kind="stable")
    rows = rows[order]
    normals, toward = np.ascontiguousarray(normals[rows].T), np.tile([[0.0], [0.0], [1.0]], rows.size)
    return SphereEvents(late_s[order], normals, pick[rows] % 2, toward, np.full(rows.size, 16.5))


@pytest.mark.parametrize(("apart_s", "meet"), [(contrast.APART_S, True), (0.0, False)])
def test_a_spin_by_which_visits_meet_outweighs_slower_ones(
    apart_s: float, meet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pixels that report in disorder make slower spins sharper at each moment; the logo shows for 2.2 turns."""
    monkeypatch.setattr(contrast, "APART_S", apart_s)
    spin_rps = np.array([70.0, 30.0, -20.0])
    answer = estimate_spin(short_visits(spin_rps), BALL, ContrastSettings())
    assert answer.spin_rps is not None
    assert (answer.linked_share > search.LEAST_LINKED) == meet
    assert (abs(np.linalg.norm(answer.spin_rps) / np.linalg.norm(spin_rps) - 1.0) < 0.01) == meet


def test_a_stray_event_before_the_logos_visit_does_not_make_it_longer() -> None:
    visit = dotted_ball(SPIN, duration_s=0.005, events=300)
    early = replace(visit, t_s=np.concatenate([[-0.05], visit.t_s[1:]]))
    drifting = replace(BALL, track_std_px=0.2, drift_std_px_s=9e9)
    plain, strayed = (estimate_spin(one, drifting, ContrastSettings(), starts_rps=SPIN[None]) for one in (visit, early))
    assert strayed.span_s > 9 * plain.span_s
    assert np.trace(strayed.covariance_rps2) == pytest.approx(np.trace(plain.covariance_rps2), rel=0.3)
    assert strayed.linked_share == pytest.approx(plain.linked_share, rel=0.05)


def test_polarities_that_disagree_are_stated() -> None:
    """ON events that drift over the disc, OFF events that do not."""
    events = dotted_ball(SPIN, duration_s=0.01, events=600)
    shift = events.t_s - events.t_s.mean()
    rising = events.polarity == 1
    drifting = events.normals.copy()
    drifting[0] += np.where(rising, 20.0 * shift, 0.0)  # 20 radii a second across the image
    drifting /= np.linalg.norm(drifting, axis=0)
    agree = estimate_spin(events, BALL, ContrastSettings(), starts_rps=SPIN[None])
    disagree = estimate_spin(replace(events, normals=drifting), BALL, ContrastSettings(), starts_rps=SPIN[None])
    assert np.trace(disagree.kept_rps2) > 4.0 * np.trace(agree.kept_rps2)


def test_following_keeps_what_only_a_full_estimate_finds() -> None:
    events = dotted_ball(SPIN, duration_s=0.04, events=900)
    first = estimate_spin(events.at(events.t_s < 0.012), BALL, ContrastSettings())
    known = replace(first, kept_rps2=9.0 * np.eye(3))
    plain, kept = (
        follow_spin(events, BALL, ContrastSettings(), before)
        for before in (replace(first, kept_rps2=np.zeros((3, 3))), known)
    )
    np.testing.assert_allclose(kept.covariance_rps2 - plain.covariance_rps2, 9.0 * np.eye(3), atol=1e-9)
    np.testing.assert_array_equal(kept.rivals_rps, first.rivals_rps)


def test_each_rival_has_a_covariance() -> None:
    events = dotted_ball(SPIN, duration_s=0.012, events=300)
    answer = estimate_spin(events, BALL, ContrastSettings(), starts_rps=np.stack([SPIN, -SPIN]))
    assert len(answer.rivals_rps) == len(answer.rival_covariances_rps2) == len(answer.margins) > 0
    assert all(np.linalg.eigvalsh(covariance).min() > 0 for covariance in answer.rival_covariances_rps2)


@pytest.mark.parametrize(("margin", "widened"), [(2.6, True), (2.8, False)])
def test_a_near_rival_widens_the_error_unless_its_odds_are_negligible(margin: float, widened: bool) -> None:
    plain, added = added_by_rival(lambda spin_rps: 1.1 * spin_rps, margin)
    odds = math.exp(-LOG_ODDS_PER_SIGMA * margin)
    expected = np.outer(plain, plain) * 0.01 * odds / (1.0 + odds) if widened else np.zeros((3, 3))
    np.testing.assert_allclose(added, expected, atol=1e-9)


def test_a_near_rival_of_the_same_magnitude_widens_the_axis_alone() -> None:
    angle = math.radians(14)

    def turned(spin_rps: np.ndarray) -> np.ndarray:
        across = np.cross(spin_rps, [0.0, 0.0, 1.0])
        across *= np.linalg.norm(spin_rps) / np.linalg.norm(across)
        return math.cos(angle) * spin_rps + math.sin(angle) * across

    spin_rps, added = added_by_rival(turned, 1.0)
    axis, odds = spin_rps / np.linalg.norm(spin_rps), math.exp(-LOG_ODDS_PER_SIGMA)
    assert axis @ added @ axis == pytest.approx(0.0, abs=1e-9)
    assert np.trace(added) == pytest.approx((angle * np.linalg.norm(spin_rps)) ** 2 * odds / (1.0 + odds))


def added_by_rival(rival: Callable[[np.ndarray], np.ndarray], margin: float) -> tuple[np.ndarray, np.ndarray]:
    """An answer, and what `rival(answer)` adds to its covariance."""
    events = dotted_ball(SPIN, duration_s=0.012, events=300)
    plain = estimate_spin(events, BALL, ContrastSettings(), starts_rps=SPIN[None])
    some, stretch = contrast._centred(events)
    spins = 2 * math.pi * np.stack([plain.spin_rps, rival(plain.spin_rps)])
    given, margins = replace(plain, kept_rps2=np.zeros((3, 3))), np.array([0.0, margin])
    answer, alone = (
        contrast._with_alternatives(given, some, spins[:k], margins[:k], BALL, ContrastSettings(), stretch)
        for k in (2, 1)
    )
    return plain.spin_rps, answer.kept_rps2 - alone.kept_rps2


def result(**changes: object) -> ContrastResult:
    nothing = ContrastResult.nothing(SpinEstimate.refused("contrast", "in doubt"))
    known = {
        "best_rps": SPIN,
        "covariance_rps2": np.eye(3),
        "rivals_rps": -SPIN[None],
        "rival_covariances_rps2": 4.0 * np.eye(3)[None],
        "rival_sigmas": np.array([1.5]),
        "pattern": "turning",
    }
    return replace(nothing, **(known | changes))


def test_the_likelihood_of_a_spin_is_that_of_its_nearest_candidate() -> None:
    spins = np.stack([SPIN, SPIN + np.eye(3)[0], -SPIN, -SPIN + 2.0 * np.eye(3)[1], [0, 0, 90.0]])
    rival = -1.5 * LOG_ODDS_PER_SIGMA
    np.testing.assert_allclose(result().log_likelihood(spins), [0.0, -0.5, rival, rival - 0.5, UNEXPLAINED])


def test_where_nothing_turns_no_spin_is_likelier() -> None:
    assert not result(pattern="unclear").log_likelihood(np.stack([SPIN, -SPIN])).any()
    nothing = ContrastResult.nothing(SpinEstimate.refused("contrast", "no ball"))
    assert nothing.log_likelihood(SPIN).tolist() == [0.0]
