"""Declaration of a rival: what the methods of other publications have in common as stages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...results import MethodResult, SpinEstimate
from ...stage import Context, SpinMethod
from ..parameters import SpinParameters


def rival(
    name: str,
    label: str,
    help: str,
    colour: tuple[int, int, int],
    *,
    inputs: tuple[str, ...],
    state: Callable[[str, SpinParameters, Context], Any],
    reads: tuple[str, ...] = (),
) -> SpinMethod:
    """Declare a method of another publication, run only when named and never trusted.

    Parameters
    ----------
    name, label, help, colour, inputs, reads
        Of the stage.
    state : callable
        `state(name, parameters, context)` makes the state of a shot, with `estimate(*inputs) -> SpinEstimate`.
    """

    def start(parameters: SpinParameters, context: Context) -> Any:
        return state(name, parameters, context)

    def step(parameters: SpinParameters, state: Any, *inputs: Any) -> MethodResult:
        return MethodResult(state.estimate(*inputs))

    def absent(parameters: SpinParameters, reason: str) -> MethodResult:
        return MethodResult(SpinEstimate.refused(name, reason))

    return SpinMethod(
        name=name,
        label=label,
        help=f"Rival: {help}",
        inputs=inputs,
        parameters=SpinParameters,
        start=start,
        step=step,
        absent=absent,
        reads=reads,
        is_slow=True,
        is_rival=True,
        colour=colour,
    )
