"""The logo's painting against its obvious twins, and what must hold of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.kernels.derotated_logo import (
    Canvas,
    centroid,
    colour_counts,
    count_derotated,
    full_count,
    paint,
    sample_density,
)
from tests.reference.derotated_logo import CELLS, Sampler, density, tone
from tests.reference.rotation import turned

seeds = st.integers(0, 2**32 - 1)


def unit_vectors(random: np.random.Generator, count: int) -> np.ndarray:
    found = random.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@given(spin_rps=st.tuples(*[st.floats(-80, 80)] * 3).map(np.array))
def test_turning_back_undoes_turning(spin_rps: np.ndarray) -> None:
    points, seconds = unit_vectors(np.random.default_rng(0), 20), np.linspace(-0.1, 0.1, 20)
    there = turned(points, spin_rps, seconds)
    np.testing.assert_allclose(np.linalg.norm(there, axis=1), 1)
    np.testing.assert_allclose(turned(there, spin_rps, -seconds), points, atol=1e-9)


def test_turning_is_by_the_right_hand_rule() -> None:
    """A quarter of a turn about z carries x to y; for a short time the way is omega x e."""
    quarter = turned(np.array([[1.0, 0.0, 0.0]]), np.array([0.0, 0.0, 10.0]), np.array([0.025]))
    np.testing.assert_allclose(quarter, [[0, 1, 0]], atol=1e-12)
    points, spin_rps, step_s = unit_vectors(np.random.default_rng(0), 50), np.array([3.0, -2.0, 5.0]), 1e-6
    moved = (turned(points, spin_rps, np.full(50, step_s)) - points) / step_s
    np.testing.assert_allclose(moved, np.cross(2 * np.pi * spin_rps, points), atol=1e-2)


def counted(normals: np.ndarray, on: np.ndarray, seconds: np.ndarray, spin_rps: np.ndarray) -> np.ndarray:
    made = np.full((CELLS, CELLS, CELLS, 3), np.nan, np.float32)  # whatever was in it before is gone
    count_derotated(made, normals, on, seconds, spin_rps)
    return made


@given(seed=seeds, count=st.integers(0, 400), still=st.booleans())
@settings(max_examples=40, deadline=None)
def test_counting_is_turning_and_smoothing_the_whole_cube(seed: int, count: int, still: bool) -> None:
    random = np.random.default_rng(seed)
    # Some lie close together, as a logo's do.
    normals = unit_vectors(random, count)
    normals[: count // 2] = unit_vectors(random, 1) + 0.02 * random.normal(size=(count // 2, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    on, seconds = random.random(count) < 0.5, random.uniform(-0.1, 0, count)
    spin_rps = np.zeros(3) if still else random.normal(size=3) * 60
    made = counted(normals, on, seconds, spin_rps)
    there = turned(normals, spin_rps, seconds)
    for polarity, chosen in ((0, ~on), (1, on)):
        np.testing.assert_array_equal(made[..., polarity].ravel(), density(there[chosen]))


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_reading_is_linear_between_the_cells_in_any_frame(seed: int) -> None:
    random = np.random.default_rng(seed)
    normals, on = unit_vectors(random, 200), random.random(200) < 0.5
    made = counted(normals, on, np.zeros(200), np.zeros(3))
    frame, _ = np.linalg.qr(random.normal(size=(3, 3)))
    directions = unit_vectors(random, 500)
    found = np.empty((2, 500), np.float32)
    sample_density(found, made, directions, frame)
    sampler = Sampler(directions @ frame)
    for polarity, chosen in ((0, ~on), (1, on)):
        np.testing.assert_allclose(found[polarity], sampler(density(normals[chosen])), rtol=1e-5, atol=1e-7)


@given(seed=seeds, share=st.floats(0, 1))
@settings(max_examples=40, deadline=None)
def test_colours_grow_with_the_counts_over_the_ground(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    counts = (random.random((2, 300)) * (random.random((2, 300)) < share)).astype(np.float32)
    colours = random.integers(0, 256, (2, 3)).astype(np.float32)
    ground = random.integers(0, 256, 3).astype(np.float32)
    places = random.permutation(400)[:300]
    picture = np.full((400, 3), 7, np.uint8)
    colour_counts(picture, places, counts, colours, ground)
    expected = np.tile(ground, (300, 1))
    for count, colour in zip(counts, colours, strict=True):
        expected += tone(count, full_count(count))[:, None] * (colour - ground)
    assert np.abs(picture[places].astype(float) - expected.clip(0, 255)).max() <= 1
    untouched = np.setdiff1d(np.arange(400), places)
    assert (picture[untouched] == 7).all()


def test_a_twentieth_of_the_marked_places_exceed_the_full_count() -> None:
    counts = np.concatenate([np.zeros(900), np.arange(1, 101)]).astype(np.float32)
    assert full_count(counts) == 95.0
    assert full_count(np.zeros(5, np.float32)) == 0.0


def test_a_right_spin_gives_the_sharpest_picture() -> None:
    spin_rps, seconds = np.array([40.0, -20.0, 10.0]), np.random.default_rng(1).uniform(0, 0.1, 3000)
    logo = np.tile([[0.0, 0.3, -1.0], [0.2, -0.2, -1.0]], (1500, 1))
    logo /= np.linalg.norm(logo, axis=1, keepdims=True)
    seen, on = turned(logo, spin_rps, seconds), np.ones(3000, np.bool_)

    def sharpness(guess: np.ndarray) -> float:
        return float(np.square(counted(seen, on, -seconds, guess)[..., 1]).sum())

    right = sharpness(spin_rps)
    for wrong in (0.9 * spin_rps, -spin_rps, np.zeros(3), spin_rps[::-1]):
        assert sharpness(wrong) < 0.5 * right


@pytest.mark.parametrize("direction", [*np.eye(3), *-np.eye(3), [0.6, 0.0, -0.8]])
def test_density_peaks_where_the_events_are_and_nowhere_else(direction: np.ndarray) -> None:
    made = counted(np.tile(np.array(direction, float), (100, 1)), np.ones(100, np.bool_), np.zeros(100), np.zeros(3))
    directions = unit_vectors(np.random.default_rng(0), 20_000)
    found = np.empty((2, 20_000), np.float32)
    sample_density(found, made, directions, np.eye(3))
    assert not found[0].any()
    assert directions[np.argmax(found[1])] @ direction > np.cos(np.radians(3))
    assert np.all((directions @ direction)[found[1] > 0] > np.cos(np.radians(10)))


def painting(seed: int, spins_rps: np.ndarray, seen: np.ndarray, colours: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """Moments painted in one call, and the same one after the other by the kernels it is made of."""
    random = np.random.default_rng(seed)
    normals, on, seconds = unit_vectors(random, 60), random.random(60) < 0.5, random.uniform(-0.1, 0, 60)
    directions, places = unit_vectors(random, 50), random.permutation(70)[:50]
    canvas = Canvas(
        places, directions, random.integers(0, 256, (colours, 3)).astype(np.float32), np.full(3, 20, np.float32)
    )
    frames = np.array([np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in spins_rps])
    made = np.full((len(spins_rps), 70, 3), 7, np.uint8)
    paint((made,), (canvas,), (frames,), normals, on, seconds, seen, spins_rps)
    expected = []
    for (first, last), spin_rps, frame in zip(seen, spins_rps, frames, strict=True):
        counted_cells = counted(normals[first:last], on[first:last], seconds[first:last], spin_rps)
        counts, picture = np.empty((2, 50), np.float32), np.full((70, 3), 7, np.uint8)
        sample_density(counts, counted_cells, directions, frame)
        counts = counts.sum(axis=0, keepdims=True) if colours == 1 else counts
        colour_counts(picture, places, counts, canvas.colours, canvas.ground)
        expected.append(picture)
    return made, expected


@given(seed=seeds, colours=st.integers(1, 2))
@settings(max_examples=20, deadline=None)
def test_painting_is_counting_reading_and_colouring_moment_by_moment(seed: int, colours: int) -> None:
    spins_rps = np.random.default_rng(seed).normal(size=(3, 3)) * 40
    made, expected = painting(seed, spins_rps, np.array([[0, 10], [0, 60], [30, 30]]), colours)
    for one, other in zip(made, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_the_centroid_is_the_mean_of_the_events_directions(seed: int) -> None:
    random = np.random.default_rng(seed)
    normals = unit_vectors(random, 1) + 0.1 * random.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middle = centroid(counted(normals, random.random(200) < 0.5, np.zeros(200), np.zeros(3)))
    mean = normals.mean(axis=0)
    assert middle @ mean > 0.9999 * np.linalg.norm(middle) * np.linalg.norm(mean)
    assert not centroid(np.zeros((CELLS, CELLS, CELLS, 3), np.float32)).any()


def digest() -> list[float]:
    """Numbers of everything here, for the comparison without the JIT."""
    random = np.random.default_rng(5)
    made = counted(unit_vectors(random, 60), random.random(60) < 0.5, np.linspace(-0.1, 0, 60), np.array([9.0, -4, 3]))
    counts, picture = np.empty((2, 200), np.float32), np.zeros((200, 3), np.uint8)
    sample_density(counts, made, unit_vectors(random, 200), np.eye(3))
    colour_counts(picture, np.arange(200), counts, np.full((2, 3), 250, np.float32), np.full(3, 20, np.float32))
    painted, _ = painting(5, np.array([[9.0, -4, 3], [0, 0, 0]]), np.array([[0, 20], [0, 60]]), 2)
    sums = [*map(float, made.sum(axis=(0, 1, 2))), *map(float, counts.sum(axis=1)), float(picture.sum())]
    return [*sums, float(painted.sum())]


@pytest.mark.nojit
def test_without_the_jit_everything_is_the_same_and_nothing_overflows() -> None:
    code = (
        "import json, sys, warnings\n"
        "from tests.pipeline.kernels.test_derotated_logo import digest\n"
        "warnings.simplefilter('error')\n"
        "sys.stdout.write(json.dumps(digest()))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(json.loads(done.stdout), digest(), rtol=1e-4)
