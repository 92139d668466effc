"""Words of coaches: the hitter's view, mixtures, spin effect, confidence; statistics of series."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.app.coach.logo_texture import TEXTURE_PX, octahedral_directions, octahedral_pixels
from spinscope.app.coach.shot_record import PARTS, hitter_frame
from spinscope.app.coach.statistics import compared, series_statistics, spread_ellipse
from spinscope.app.coach.terms import clock_hours, confidence, effect_word, mixture, spin_effect
from spinscope.pipeline.spin_terms import kind_of_spin

UP = np.array([0.0, 0.0, -1.0])


def components(spin_rps: np.ndarray, velocity: np.ndarray) -> dict[str, float]:
    parts = kind_of_spin(spin_rps, velocity, tuple(UP)).parts_rps
    return {column: parts[part] for column, part in PARTS.items()}


@pytest.mark.parametrize("code", ["topspin", "backspin", "left_sidespin", "right_sidespin"])
def test_the_ball_bends_where_the_clock_says(code: str) -> None:
    """Lift is along spin x velocity: topspin dips, left sidespin goes left as the hitter sees it."""
    velocity = np.array([8.0, 3.0, 0.0])
    right, up, forward = np.array(hitter_frame(velocity, UP))
    spin = {"topspin": -right, "backspin": right, "left_sidespin": up, "right_sidespin": -up}[code] * 40.0
    assert mixture(components(spin, velocity), 40.0) == [code]
    lift = np.cross(spin, velocity)
    parts = components(spin, velocity)
    angle = math.radians(30 * clock_hours(parts["topspin_rps"], parts["sidespin_rps"]))
    assert [lift @ right, lift @ up] / np.linalg.norm(lift) == pytest.approx([math.sin(angle), math.cos(angle)])
    assert np.cross(right, up) == pytest.approx(-forward)  # right, up, back to the hitter: right-handed


def test_a_right_corkscrew_jumps_to_the_right_off_the_table() -> None:
    velocity = np.array([8.0, 0.0, 0.0])
    right, up, forward = np.array(hitter_frame(velocity, UP))
    spin = 40.0 * forward
    assert mixture(components(spin, velocity), 40.0) == ["right_corkscrew"]
    lowest = np.cross(spin, -up)  # velocity of the lowest point; friction pushes the ball the other way
    assert -lowest @ right > 0


@pytest.mark.parametrize(
    ("parts", "codes"),
    [
        ((50, 0, 0), ["topspin"]),
        ((50, -20, 0), ["topspin", "some right_sidespin"]),
        ((40, -35, 0), ["topspin", "and right_sidespin"]),
        ((-40, 5, -20), ["backspin", "some left_corkscrew"]),
        ((30, 30.1, 30), ["left_sidespin", "some topspin", "some right_corkscrew"]),
        ((3, 2, 1), ["no_spin"]),
    ],
)
def test_mixtures_are_named(parts: tuple[float, ...], codes: list[str]) -> None:
    names = dict(zip(("topspin_rps", "sidespin_rps", "corkscrew_rps"), parts, strict=True))
    found = mixture(names, math.hypot(*parts))
    assert [code.replace("and", "some") for code in found] == [code.replace("and", "some") for code in codes]
    if len(codes) == 2:
        assert found == codes


def test_a_rolling_ball_has_spin_effect_one() -> None:
    speed_m_s, radius_m = 7.0, 0.020
    assert spin_effect(speed_m_s / (2 * math.pi * radius_m), speed_m_s) == pytest.approx(1.0)
    assert [effect_word(effect) for effect in (0.3, 1.0, 1.5)] == ["speedy", "neutral", "spinny"]


def test_confidence_falls_with_the_stated_errors() -> None:
    assert confidence(50, 0.4, 1) == "sure" and confidence(50, 4, 5) == "good" and confidence(50, 0.4, 20) == "rough"
    assert confidence(8, 0.4, 1) == "sure"  # half a revolution a second is nothing, whatever share it is
    assert confidence(50, None, None) == "rough"


@given(st.lists(st.tuples(*3 * [st.floats(-1, 1)]), min_size=1, max_size=20))
def test_a_textures_pixel_lies_in_its_direction(vectors: list[tuple[float, float, float]]) -> None:
    directions = np.array([vector for vector in vectors if math.hypot(*vector) > 0.1])
    if not len(directions):
        return
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = octahedral_directions(TEXTURE_PX)[octahedral_pixels(directions, TEXTURE_PX)]
    assert np.degrees(np.arccos(np.clip(np.sum(found * directions, axis=1), -1, 1))).max() < 3.5


def rows(spins: list[float | None], speeds: list[float] | None = None) -> list[dict[str, Any]]:
    speeds = speeds or [10.0 + i % 3 for i in range(len(spins))]
    return [{"id": i, "spin_rps": spin, "speed_m_s": v} for i, (spin, v) in enumerate(zip(spins, speeds, strict=True))]


def test_a_series_tells_best_spread_and_what_was_not_seen() -> None:
    found = series_statistics(rows([50, None, 60, 55]))
    assert (found.count, found.unseen, found.median_rps, found.best_rps, found.best_id) == (3, 1, 55, 60, 2)
    assert found.spread_rps == pytest.approx(5.0) and found.trend == "too_few"
    nothing = series_statistics(rows([None]))
    assert (nothing.count, nothing.median_rps, nothing.ellipse, nothing.best_id) == (0, None, None, None)


def test_a_trend_is_told_only_beyond_chance() -> None:
    assert series_statistics(rows([50, 52, 51, 60, 61, 59])).trend == "rose"
    assert series_statistics(rows([60, 61, 59, 50, 52, 51])).trend == "fell"
    random = np.random.default_rng(5)
    trends = [series_statistics(rows(list(random.normal(50, 5, 20)))).trend for _ in range(300)]
    assert trends.count("unclear") > 0.9 * 300


def test_the_strongest_is_told_only_beyond_chance() -> None:
    series = {"weak": [50, 52, 51, 49], "strong": [60, 61, 59, 62], "few": [99, 98], "one": [60.5, 58.0, 63.0, 60.0]}
    found = {name: series_statistics(rows(list(spins))) for name, spins in series.items()}
    assert compared(found) == (["strong", "one", "weak"], False)
    del found["one"]
    assert compared(found) == (["strong", "weak"], True)
    other = series_statistics(rows([60, 61, 59, 62, 11]))  # a single other shot does not hide it
    assert compared({**found, "strong": other}) == (["strong", "weak"], True)
    assert compared({"few": found["few"]}) == ([], False)


def test_what_was_before_an_instant_is_compared_with_what_came_after() -> None:
    dated = [{**row, "recorded_s": float(i)} for i, row in enumerate(rows([60, 61, 59, 50, None, 52, 51, 50]))]
    found = series_statistics(dated, since_s=3.0)
    assert found.trend == "fell" and found.change_rps == pytest.approx(50.75 - 60)
    assert series_statistics(dated, since_s=2.0).trend == "too_few"  # two before
    assert series_statistics(dated, since_s=99.0).trend == "too_few"


def test_the_ellipse_holds_two_of_three_shots() -> None:
    random = np.random.default_rng(6)
    speeds, spins = random.multivariate_normal([10, 60], [[4, 6], [6, 25]], 20_000).T
    outline = np.array(spread_ellipse(speeds, spins))
    centre = outline.mean(axis=0)
    # Inside a convex outline: on the same side of all its edges.
    edges, points = np.roll(outline, -1, axis=0) - outline, np.stack([speeds, spins], axis=1)
    sides = np.stack(
        [e[0] * (points[:, 1] - p[1]) - e[1] * (points[:, 0] - p[0]) for e, p in zip(edges, outline, strict=True)]
    )
    inward = np.sign(edges[0][0] * (centre[1] - outline[0][1]) - edges[0][1] * (centre[0] - outline[0][0]))
    assert np.mean(np.all(sides * inward > 0, axis=0)) == pytest.approx(2 / 3, abs=0.01)


@pytest.mark.parametrize("count", [4, 9, 30])
def test_one_shot_of_another_kind_does_not_turn_the_ellipse(count: int) -> None:
    random = np.random.default_rng(count)
    speeds, spins = random.multivariate_normal([10, 60], [[4, 0], [0, 25]], count).T
    with_other = np.array(spread_ellipse(np.append(speeds, 25.0), np.append(spins, 5.0)))
    assert np.all(np.abs(with_other - [10, 60]) < [6, 16])


def test_the_ellipse_of_shots_on_a_line_is_that_line() -> None:
    outline = np.array(spread_ellipse(np.full(5, 10.0), np.arange(50.0, 55.0)))
    assert np.ptp(outline[:, 0]) < 0.01 and 1 < np.ptp(outline[:, 1]) < 6
