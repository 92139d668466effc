"""Parameters of the contrast method: its kernel, its window, and what its answers need to be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import ParameterGroup, switch, tunable

METHOD, FLOW_METHOD = "contrast", "normal_flow"


@dataclass(frozen=True, kw_only=True)
class ContrastParameters(ParameterGroup):
    """Kernel, window, and what is trusted."""

    renamed: ClassVar[dict[str, str]] = {"weakest": "min_gain"}

    kernel_rad: float = tunable(
        0.04, 0.01, 0.3, 0.005, "rad", "how near on the ball events must come to count as one (1 sigma)"
    )
    floor_events: float = tunable(1.5, 0.1, 100.0, 0.1, "events", "density below which differences mean little")
    window_us: int = tunable(500_000, 5000, 10_000_000, 5000, "us", "how far back in time events may lie")
    fewest_events: int = tunable(40, 10, 10_000, 10, "events", "logo events needed for an answer")
    min_gain: float = tunable(
        0.25, 0.0, 5.0, 0.05, "", "contrast that an event must gain over permuted times (natural log), on average"
    )
    rival_sigmas: float = tunable(1.2, 0.0, 20.0, 0.1, "sigma", "lead that the best spin must have over any other")
    # On 110 simulated flights that contrast answers rightly one in a hundred is farther away than 5.7.
    flow_sigmas: float = tunable(
        6.0,
        0.0,
        100.0,
        0.5,
        "sigma",
        "distance from the normal flow's spin that puts it in doubt, unless it is settled",
    )
    # In 122 flights of our simulator without a contact they are 3.1 apart at most, right after a hit 5.4.
    change_sigmas: float = tunable(
        8.0,
        0.0,
        100.0,
        0.5,
        "sigma",
        "distance between the spins of the flight's first and last third that shows a missed contact",
    )
    smallest_patch_rad: float = tunable(
        0.18, 0.0, 1.5, 0.01, "rad", "spread of the logo's events over the ball (rms) below which it is not seen"
    )
    axis_std_deg: float = tunable(12.0, 0.1, 180.0, 0.5, "deg", "largest stated error of the axis (1 sigma)")
    magnitude_std_rps: float = tunable(
        3.0, 0.01, 1000.0, 0.1, "rps", "largest stated error of the magnitude (1 sigma); a tenth of it if that is more"
    )
    curves: bool = switch(True, "score over magnitude and over axis directions, for the viewer")
