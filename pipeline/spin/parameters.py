"""Parameters that the spin methods share."""

from __future__ import annotations

from dataclasses import dataclass

from ..parameters import ParameterGroup, choice, tunable

# The choices of magnitude_from: whether the event rate may give the magnitude.
TAKES_RATE = {"rate": True, "flow": False}


@dataclass(frozen=True, kw_only=True)
class SpinParameters(ParameterGroup):
    """Bounds and window of every method, and the variants of the paper's."""

    max_spin_rps: float = tunable(
        150.0, 1.0, 1000.0, 5.0, "rps", "highest spin looked for or answered; bounds the flow's speed"
    )
    window_us: int = tunable(
        500_000, 5000, 10_000_000, 5000, "us", "how far back in time the events of an estimate may lie"
    )
    magnitude_from: str = choice(
        "rate",
        tuple(TAKES_RATE),
        "magnitude: from the event rate's zero crossings where they are regular, or from flow alone",
    )
    triplet_solve: str = choice("paper", ("paper", "least_squares"), "triplet: the paper's mean, or full rank")
