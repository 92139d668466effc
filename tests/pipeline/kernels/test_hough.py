"""The Hough vote equals its slow twin, and finds the circles that are there."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import hough
from tests.columns import read_only
from tests.reference import hough as reference


def pixels_of_circle(x_px: float, y_px: float, radius_px: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    angle = np.linspace(0, 2 * math.pi, 200, endpoint=False)
    points = np.stack([x_px + radius_px * np.cos(angle), y_px + radius_px * np.sin(angle)], axis=1)
    drawn = np.unique(np.rint(points).astype(np.int64), axis=0)
    return drawn[:, 0].copy(), drawn[:, 1].copy()


@given(
    height=st.integers(1, 20),
    width=st.integers(1, 20),
    radii=st.integers(1, 6),
    radius0=st.integers(1, 8),
    x0=st.integers(-10, 10),
    y0=st.integers(-10, 10),
    seed=st.integers(0, 2**32 - 1),
)
def test_votes_equal_the_twin(height: int, width: int, radii: int, radius0: int, x0: int, y0: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(-15, 25, (2, rng.integers(0, 25)))
    votes = np.zeros((height, width, radii), np.uint16)
    hough.vote(votes, x, y, x0, y0, radius0)
    assert np.array_equal(votes, reference.vote(votes.shape, x, y, x0, y0, radius0))
    assert hough.peak(votes, radius0) == reference.peak(votes, radius0)


@given(x=st.floats(-3, 33), y=st.floats(-3, 33), radius=st.floats(5, 14))
def test_the_peak_is_the_circle(x: float, y: float, radius: float) -> None:
    """Also with a third of it, or more, outside the image."""
    xs, ys = pixels_of_circle(x, y, radius)
    seen = (xs >= 0) & (ys >= 0) & (xs < 30) & (ys < 30)
    if np.count_nonzero(seen) < 0.6 * seen.size:
        return
    votes = np.zeros((50, 50, 14), np.uint16)
    hough.vote(votes, xs[seen], ys[seen], -10, -10, 3)
    _, a, b, k = hough.peak(votes, 3)
    fine_a, fine_b, fine_k = hough.refined(votes, a, b, k)
    assert math.hypot(fine_a - 10 - x, fine_b - 10 - y) < 1.5
    assert abs(fine_k + 3 - radius) < 1.5


def test_the_refined_peak_is_the_centre_of_mass_of_squares() -> None:
    votes = np.zeros((5, 6, 4), np.uint16)
    votes[2, 3, 1], votes[2, 4, 1], votes[2, 3, 2], votes[0, 0, 3] = 2, 1, 1, 9
    a, b, k = hough.refined(votes, 3, 2, 1)
    assert (a, b, k) == (3 + 1 / 6, 2.0, 1 + 1 / 6)
    assert hough.refined(np.zeros((3, 3, 3), np.uint16), 1, 1, 1) == (1.0, 1.0, 1.0)


@given(height=st.integers(1, 9), width=st.integers(1, 9), most=st.integers(1, 20), seed=st.integers(0, 2**32 - 1))
def test_bright_pixels_equal_the_twin(height: int, width: int, most: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)
    for found, expected in zip(
        hough.bright_pixels(image, 128, most), reference.bright_pixels(image, 128, most), strict=True
    ):
        assert np.array_equal(found, expected)


@given(
    height=st.integers(1, 20),
    width=st.integers(1, 20),
    cell=st.integers(1, 5),
    events=st.integers(0, 30),
    seed=st.integers(0, 2**32 - 1),
)
def test_active_cells_equal_the_twin(height: int, width: int, cell: int, events: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 256, (height, width)).astype(np.uint8)
    x = rng.integers(0, width, events).astype(np.uint16)
    y = rng.integers(0, height, events).astype(np.uint16)
    columns, rows = hough.active_cells(*read_only(values, x, y), 100, cell)
    assert list(zip(columns, rows, strict=True)) == reference.active_cells(values, x, y, 100, cell)


@given(
    pixels=st.lists(st.tuples(st.integers(0, 25), st.integers(0, 15)), min_size=1, max_size=60, unique=True),
    radius0=st.integers(1, 4),
    radii=st.integers(1, 5),
    most=st.integers(1, 4),
)
def test_the_best_circles_are_the_peaks_of_the_vote(
    pixels: list[tuple[int, int]], radius0: int, radii: int, most: int
) -> None:
    """One peak after the other, each with the votes around the last one taken away."""
    xs, ys = np.array(pixels).T.copy()
    memory = np.zeros(60 * 50 * 5, np.uint16)
    supports, circles = hough.best_circles(memory, *read_only(xs, ys), radius0, radii, most, 1.0)
    assert not memory.any(), "ready for the next vote"
    votes = reference.vote((40, 50, radii), xs, ys, -10, -10, radius0)
    for support, (x, y, radius) in zip(supports.tolist(), circles.tolist(), strict=True):
        assert (support, x + 10, y + 10, radius - radius0) == reference.peak(votes, radius0)
        near = max(1, radius // 2)
        votes[max(0, y + 10 - near) : y + 11 + near, max(0, x + 10 - near) : x + 11 + near] = 0
    assert len(supports) == most or reference.peak(votes, radius0)[0] < 1.0


@given(seed=st.integers(0, 2**32 - 1))
def test_the_best_circle_is_the_peak_of_the_vote(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xs, ys = rng.integers(0, 40, (2, int(rng.integers(0, 60))))
    votes = reference.vote((11, 11, 4), xs, ys, 15, 16, 6)
    support, a, b, k = reference.peak(votes, 6)
    found = hough.best_circle(xs, ys, 15, 16, 11, 6, 4)
    if support == 0.0:
        assert found == (0.0, 0.0, 0.0, 0.0)
        return
    x, y, radius = hough.refined(votes, a, b, k)
    share = min(1.0, votes[b, a, k] / (2 * math.pi * (6 + k)))
    assert np.allclose(found, (15 + x, 16 + y, 6 + radius, share))


@given(count=st.integers(0, 40), seed=st.integers(0, 2**32 - 1))
def test_cells_of_twice_the_width_hold_the_cells(count: int, seed: int) -> None:
    columns, rows = np.random.default_rng(seed).integers(0, 12, (2, count))
    wide = hough.twice_as_wide(columns, rows)
    expected = sorted({(b // 2, a // 2) for a, b in zip(columns.tolist(), rows.tolist(), strict=True)})
    assert list(zip(wide[1].tolist(), wide[0].tolist(), strict=True)) == expected
