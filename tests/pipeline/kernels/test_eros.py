"""Life counters equal the reference's float64 EROS, to the last of the rounded bits, and TOS."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import eros
from tests.columns import read_only
from tests.reference.surface import NaiveEros, NaiveTos

SAMPLES = sorted((Path(__file__).parents[3] / "sample_recordings").glob("*.h5"))


class Fast:
    """The kernels in the shape of the twin."""

    def __init__(self, width_px: int, height_px: int, k_px: int) -> None:
        self.width_px, self.height_px, self.k_px = width_px, height_px, eros.odd_px(k_px)
        self.levels, self.table = eros.empty_levels(width_px, height_px), eros.value_table(k_px)

    def draw(self, x_px: NDArray[np.uint16], y_px: NDArray[np.uint16]) -> None:
        eros.update(self.levels, self.width_px, self.k_px, len(self.table) - 1, *read_only(x_px, y_px))

    def read(self) -> NDArray[np.uint8]:
        values = np.zeros((self.height_px, self.width_px), np.uint8)
        eros.render(values, eros.image_levels(self.levels, self.width_px, self.height_px).copy(), self.table)
        return values


class FastTos(Fast):
    """The same with the table of TOS."""

    def __init__(self, width_px: int, height_px: int, k_px: int) -> None:
        super().__init__(width_px, height_px, k_px)
        self.table = eros.threshold_table(k_px)


def assert_equal_streams(
    width_px: int, height_px: int, k_px: int, packets: list[tuple[NDArray[np.uint16], NDArray[np.uint16]]]
) -> None:
    for kind, twin in ((Fast, NaiveEros), (FastTos, NaiveTos)):
        fast, slow = kind(width_px, height_px, k_px), twin(width_px, height_px, k_px)
        for x_px, y_px in packets:
            fast.draw(x_px, y_px)
            slow.draw(x_px, y_px)
            assert np.array_equal(fast.read(), slow.read())


@given(
    width=st.integers(1, 70),
    height=st.integers(1, 40),
    k_px=st.integers(1, eros.K_MAX_PX),
    crowd=st.floats(0.05, 1.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_stream_equals_the_reference(width: int, height: int, k_px: int, crowd: float, seed: int) -> None:
    """Random events over a part of the sensor, so that pixels also fade to nothing; borders all around."""
    rng = np.random.default_rng(seed)
    packets = []
    for size in rng.integers(0, 250, 4):
        left, top = rng.integers(0, width), rng.integers(0, height)
        x = left + rng.integers(0, max(1, int(crowd * (width - left))), size)
        y = top + rng.integers(0, max(1, int(crowd * (height - top))), size)
        packets.append((x.astype(np.uint16), y.astype(np.uint16)))
    assert_equal_streams(width, height, k_px, packets)


@pytest.mark.parametrize("k_px", range(1, eros.K_MAX_PX + 1, 2))
def test_a_pixel_fades_as_the_reference_from_255_to_0(k_px: int) -> None:
    """One event, then neighbours' events until nothing is left of it, read after each."""
    x = np.array([1], np.uint16) if k_px > 1 else np.array([0], np.uint16)
    one = (np.array([0], np.uint16), np.array([0], np.uint16))
    assert_equal_streams(2, 1, k_px, [one] + [(x, one[1])] * (len(eros.value_table(k_px)) + 1))


def test_the_lives_that_the_facts_name() -> None:
    assert len(eros.value_table(10)) - 1 == 57
    assert len(eros.value_table(21)) - 1 == 109
    assert len(eros.value_table(eros.K_MAX_PX)) - 1 <= 255


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_recordings_equal_the_reference(path: Path) -> None:
    """15,000 events in the middle: of the ball, and noise all over the image."""
    with h5py.File(path) as file:
        first = max(0, file["events/x"].size // 2 - 7500)
        x, y = (file[f"events/{axis}"][first : first + 15_000] for axis in "xy")
        width, height = int(file.attrs["width"]), int(file.attrs["height"])
    cuts = range(0, x.size, max(1, x.size // 4))
    assert_equal_streams(width, height, 10, [(x[i : i + cuts.step], y[i : i + cuts.step]) for i in cuts])


def test_the_threshold_is_the_published_one() -> None:
    assert eros.threshold_table(7)[:2].tolist() == [0, 241]


def test_the_margins_stay_empty() -> None:
    """What lies between the rows is shared by two of them: it must never come to life."""
    fast = Fast(13, 5, eros.K_MAX_PX)
    rng = np.random.default_rng(5)
    fast.draw(rng.integers(0, 13, 500).astype(np.uint16), rng.integers(0, 5, 500).astype(np.uint16))
    assert np.count_nonzero(fast.levels) == np.count_nonzero(fast.read())
