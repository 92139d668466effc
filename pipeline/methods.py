"""The methods that estimate the spin, and whose answer the program itself trusts."""

from __future__ import annotations

from collections.abc import Mapping

from .results import SpinEstimate

METHODS = ("triplet", "normal_flow", "contrast")
# Normal flow is trusted where it knows the axis to 7 degrees (1 sigma) and the magnitude to 3 rps or a tenth: as good
# as the best of the paper's table at 100 ms. On simulated shots the error beyond which one answer in ten lies is 1.4
# of these sigmas.
TRUSTED_AXIS_DEG, TRUSTED_RPS, TRUSTED_SHARE = 7.0, 3.0, 0.1


def best_of(estimates: Mapping[str, SpinEstimate]) -> str | None:
    """The method that is trusted; None where none is.

    Contrast where it answers, for it refuses by itself what it cannot stand for; else normal flow where it is sure of
    itself and contrast does not speak against it. Triplet never: the paper's method has no doubts of its own.
    """
    if "contrast" in estimates and estimates["contrast"].status == "ok":
        return "contrast"
    contradicted = any(estimate.against == "normal_flow" for estimate in estimates.values())
    if "normal_flow" in estimates and not contradicted and _sure(estimates["normal_flow"]):
        return "normal_flow"
    return None


def _sure(estimate: SpinEstimate) -> bool:
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return False
    return axis_std <= TRUSTED_AXIS_DEG and std <= max(TRUSTED_RPS, TRUSTED_SHARE * magnitude)
