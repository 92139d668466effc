"""The score around an answer, for people to look at: over magnitude, and over axis directions."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .contrast_events import Answer, LogoEvents, Settings
from .contrast_scan import hill_of
from .contrast_search import TURN, scored, spread_directions

Floats = NDArray[np.float64]
MAGNITUDES, DIRECTIONS = 41, 100


class Picture(NamedTuple):
    """The score an event.

    magnitudes_rps, magnitude_scores : (m,) along the answer's axis
    directions, direction_scores : (d, 3) and (d,) over all axes at the answer's magnitude
    """

    magnitudes_rps: Floats
    magnitude_scores: Floats
    directions: Floats
    direction_scores: Floats

    @classmethod
    def empty(cls) -> Picture:
        return cls(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty(0))


def picture(events: LogoEvents, answer: Answer | None, settings: Settings) -> Picture:
    """Magnitudes up to twice the answer's, the answer's own among them; empty without an answer."""
    if answer is None or answer.spin_rps is None or not np.any(answer.spin_rps):
        return Picture.empty()
    sigma, some = 2.0 * settings.sigma, events.thinned(settings.scan_most)
    part = hill_of(replace(some, t_s=some.t_s - answer.reference_s), settings, sigma).part
    magnitude = float(np.linalg.norm(answer.spin_rps))
    axis = answer.spin_rps / magnitude
    magnitudes = magnitude * np.linspace(0.0, 2.0, MAGNITUDES)
    directions = np.concatenate([axis[None], spread_directions(DIRECTIONS)])
    along = scored(axis * magnitudes[:, None] * TURN, part, sigma, settings.floor)
    around = scored(directions * magnitude * TURN, part, sigma, settings.floor)
    return Picture(magnitudes, along / len(some), directions, around / len(some))
