"""Spin: one estimate a method, with its uncertainty or the reason for refusing (section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

from ..parameters import ParameterGroup, choice, tunable
from ..results import SpinEstimate

INPUTS = ("packet", "track", "logo", "rate", "flow")
METHODS = ("triplet", "normal_flow")


@dataclass(frozen=True, kw_only=True)
class SpinParameters(ParameterGroup):
    """What is asked for and what is trusted."""

    max_spin_rps: float = tunable(
        150.0, 1.0, 1000.0, 5.0, "rps", "highest spin looked for; bounds the flow's speed"
    )
    triplet_solve: str = choice(
        "paper", ("paper", "least_squares"), "triplet: the paper's mean, or full rank"
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpinResult:
    """The estimates from the present shot so far.

    estimates : one SpinEstimate a method, by name
    best : the method whose answer is trusted, None where none is
    """

    estimates: dict[str, SpinEstimate]
    best: str | None
