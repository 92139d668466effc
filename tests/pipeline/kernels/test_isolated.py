"""Cleaning against its slow twin, and on drawings whose answer one can see."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import isolated
from tests.columns import read_only
from tests.reference.surface import cleaned

RULES = ("isolated", "printed")


def window_of(values: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int, rule: str) -> NDArray[np.uint8]:
    window = np.full((y1 - y0, x1 - x0), 77, np.uint8)
    isolated.copy_cleaned(window, *read_only(values), x0, y0, rule == "printed")
    return window


def drawing(text: str) -> NDArray[np.uint8]:
    """Rows of a drawing: # = 255, . = 0."""
    return np.array([[255 * (c == "#") for c in row] for row in text.split()], np.uint8)


@given(
    width=st.integers(1, 30),
    height=st.integers(1, 30),
    share=st.sampled_from([0.02, 0.06, 0.12, 0.4, 0.9]),
    rule=st.sampled_from(RULES),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_window_is_a_cut_out_of_the_twins_image(
    width: int, height: int, share: float, rule: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    values = (rng.integers(1, 256, (height, width)) * (rng.random((height, width)) < share)).astype(np.uint8)
    for _ in range(4):  # blobs that are full, for the printed kernel
        y, x = rng.integers(0, height), rng.integers(0, width)
        values[max(0, y - 2) : y + 4, max(0, x - 2) : x + 4] = 0
        values[y : y + 2, x : x + 2] = rng.integers(1, 256)
    expected = cleaned(values, rule)
    (x0, x1), (y0, y1) = (np.sort(rng.integers(0, size + 1, 2)) for size in (width, height))
    assert np.array_equal(window_of(values, 0, 0, width, height, rule), expected)
    assert np.array_equal(window_of(values, x0, y0, x1, y1, rule), expected[y0:y1, x0:x1])


@pytest.mark.parametrize(
    ("text", "isolated_goes", "printed_goes"),
    [
        ("..... ..... ..#.. ..... .....", True, False),  # a lone pixel
        ("..... ..... ..##. ..... .....", True, False),  # a pair
        ("...... ...... ..#... ...#.. ...... ......", True, False),  # a slanting pair
        ("...... ...... ..##.. ..##.. ...... ......", True, True),  # a full block
        ("...... ...... ..##.. ..#... ...... ......", True, False),  # three of a block
        ("....... ....... ..###.. ....... .......", False, False),  # a short line is an edge
        ("#.. ... ...", True, False),  # the image ends: nothing is outside
        ("##. ##. ...", True, True),
    ],
)
def test_what_goes_can_be_seen(text: str, isolated_goes: bool, printed_goes: bool) -> None:
    values = drawing(text)
    height, width = values.shape
    for rule, goes in zip(RULES, (isolated_goes, printed_goes), strict=True):
        result = window_of(values, 0, 0, width, height, rule)
        assert np.array_equal(result, np.zeros_like(values) if goes else values)


def test_printed_removes_the_blobs_whose_anchors_the_library_finds() -> None:
    """cv2's hit-or-miss with the supplement's kernel, its anchor put on the blob's first pixel."""
    rng = np.random.default_rng(3)
    values = np.where(rng.random((60, 80)) < 0.03, 255, 0).astype(np.uint8)
    values[10:12, 20:22] = values[40:42, 50:52] = 255
    values[9, 19:23] = values[12, 19:23] = values[9:13, 19] = values[9:13, 22] = 0
    kernel = np.full((4, 4), -1, np.int32)
    kernel[1:3, 1:3] = 1
    found = cv2.morphologyEx(values, cv2.MORPH_HITMISS, kernel, anchor=(1, 1))
    found[:1], found[-3:], found[:, :1], found[:, -3:] = 0, 0, 0, 0  # the library's border differs
    expected = values.copy()
    for y, x in np.argwhere(found):
        expected[y : y + 2, x : x + 2] = 0
    assert np.count_nonzero(found)
    inner = (slice(5, -5), slice(5, -5))
    assert np.array_equal(window_of(values, 0, 0, 80, 60, "printed")[inner], expected[inner])


def test_isolated_removes_sparse_noise_that_the_printed_kernel_leaves() -> None:
    """The supplement's purpose: noise that is sparse in space goes, a ball's outline stays whole."""
    noise = np.zeros((200, 200), np.uint8)
    rng = np.random.default_rng(1)
    noise[rng.integers(0, 200, 300), rng.integers(0, 200, 300)] = 255
    outline = np.zeros_like(noise)
    cv2.circle(outline, (100, 100), 20, 255)
    noise[75:126, 75:126] = 0
    left = window_of(noise | outline, 0, 0, 200, 200, "isolated")
    assert np.count_nonzero(left & noise) < 0.15 * np.count_nonzero(noise)
    assert np.array_equal(left & outline, outline)
    left = window_of(noise | outline, 0, 0, 200, 200, "printed")
    assert np.count_nonzero(left & noise) > 0.99 * np.count_nonzero(noise)
