"""Slow twins of the surfaces and of their cleaning: the definitions in a few lines each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class NaiveEros:
    """The reference's EROS: float64, every event fades its block (k forced odd) and sets its pixel."""

    def __init__(self, width_px: int, height_px: int, k_px: int) -> None:
        k_px = k_px if k_px % 2 else k_px + 1
        self.half, self.decay = k_px // 2, 0.3 ** (1 / k_px)
        self.surface = np.zeros((height_px, width_px))

    def draw(self, x_px: NDArray[np.uint16], y_px: NDArray[np.uint16]) -> None:
        half = self.half
        for x, y in zip(x_px.tolist(), y_px.tolist(), strict=True):
            self.surface[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1] *= self.decay
            self.surface[y, x] = 255.0

    def read(self) -> NDArray[np.uint8]:
        return np.rint(self.surface).astype(np.uint8)


class NaiveTos:
    """TOS as luvHarris has it: an event takes 1 off the block around it and what falls below the threshold is 0."""

    def __init__(self, width_px: int, height_px: int, k_px: int) -> None:
        k_px = k_px if k_px % 2 else k_px + 1
        self.half, self.threshold = k_px // 2, 255 - 2 * k_px
        self.surface = np.zeros((height_px, width_px), np.int64)

    def draw(self, x_px: NDArray[np.uint16], y_px: NDArray[np.uint16]) -> None:
        half = self.half
        for x, y in zip(x_px.tolist(), y_px.tolist(), strict=True):
            block = self.surface[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1]
            block -= 1
            block[block < self.threshold] = 0
            self.surface[y, x] = 255

    def read(self) -> NDArray[np.uint8]:
        return self.surface.astype(np.uint8)


def eros_float32_loop(
    surface: NDArray[np.float32],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    half: int,
    decay: np.float32,
) -> None:
    """EROS as one would first write it for numba: the loop that the benchmark compares with."""
    height, width = surface.shape
    for i in range(x_px.size):
        x, y = int(x_px[i]), int(y_px[i])
        for row in range(max(0, y - half), min(height, y + half + 1)):
            for column in range(max(0, x - half), min(width, x + half + 1)):
                surface[row, column] *= decay
        surface[y, x] = 255.0


def recent_events(
    t_us: list[int],
    x_px: list[int],
    y_px: list[int],
    shape: tuple[int, int],
    end_us: int,
    span_us: int,
    linear: bool,
) -> NDArray[np.uint8]:
    """Accumulated frame or linear time surface of all events up to end_us, one event after the other."""
    values = np.zeros(shape, np.uint8)
    for t, x, y in zip(t_us, x_px, y_px, strict=True):
        if end_us - span_us <= t < end_us:
            brightness = 255 * (span_us - (end_us - t))
            # Rounded half up, in whole numbers.
            values[y, x] = (2 * brightness + span_us) // (2 * span_us) if linear else 255
    return values


def cleaned(values: NDArray[np.uint8], rule: str) -> NDArray[np.uint8]:
    """The whole image without the pixels that this rule removes."""
    padded = np.pad(values, 3)
    result = padded.copy()
    for y in range(1, padded.shape[0] - 3):
        for x in range(1, padded.shape[1] - 3):
            outer, inner = padded[y - 1 : y + 3, x - 1 : x + 3] > 0, padded[y : y + 2, x : x + 2] > 0
            alone = outer.sum() == inner.sum()
            if (rule == "isolated" and alone) or (rule == "printed" and alone and inner.all()):
                result[y : y + 2, x : x + 2] = 0
    return result[3:-3, 3:-3]
