"""Colours of curves, circles and polarities for eyes that are red-green blind."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.app.viewer import entities
from spinscope.pipeline.registry import methods

SERIES = {
    "truth": entities.TRUTH_COLOUR,
    "Kalman filter": entities.KALMAN_COLOUR,
    "refined circle": entities.MEASURED_COLOUR,
    "Hough": entities.HOUGH_COLOUR,
    "ON": entities.ON,
    "OFF": entities.OFF,
    "event rate": entities.RATE_COLOUR,
    # Those of other publications are drawn where they were named only, with their names.
    **{method.label: method.colour for method in methods() if not method.is_rival},
}
# Linear RGB of full protanopia and deuteranopia: Machado, Oliveira and Fernandes 2009, table 1.
SIMULATIONS = {
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
# sRGB primaries and white point D65: IEC 61966-2-1.
XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = [0.95047, 1.0, 1.08883]
LEAST_DELTA_E = 20.0
GRAPHICS_CONTRAST = 3.0  # WCAG 2.2, 1.4.11


def linear(colour: entities.Colour) -> NDArray[np.float64]:
    """Linear RGB of an sRGB colour."""
    share = np.array(colour) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIE L*a*b* of linear RGB."""
    x, y, z = np.cbrt(XYZ @ rgb / WHITE)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("eyes", SIMULATIONS)
def test_every_two_series_are_told_apart(eyes: str) -> None:
    seen = {name: lab(np.clip(SIMULATIONS[eyes] @ linear(colour), 0.01, 1)) for name, colour in SERIES.items()}
    close = {(a, b): np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(seen, 2)}
    assert {pair: round(float(d)) for pair, d in close.items() if d < LEAST_DELTA_E} == {}


def test_every_series_stands_out_from_the_ground() -> None:
    luminance = {name: float(XYZ[1] @ linear(colour)) for name, colour in SERIES.items()}
    ground = float(XYZ[1] @ linear(entities.BACKGROUND))
    ratios = {name: (own + 0.05) / (ground + 0.05) for name, own in luminance.items()}
    assert {name: ratio for name, ratio in ratios.items() if ratio < GRAPHICS_CONTRAST} == {}
