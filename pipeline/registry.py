"""The stages of the chain and the spin methods among them: the one place where they are listed.

A new stage or method is one record (`Stage`, `SpinMethod`), registered here or by whoever brings it; parameters,
`--set`, sliders, results, plots and tests follow from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from .camera import BallParameters, CameraParameters
from .errors import ParameterError
from .extensions import Registry, did_you_mean
from .parameters import ParameterGroup, ParameterSet
from .results import SpinEstimate
from .spin import combined, contrast, normal_flow, rivals, trajectory, triplet
from .stage import SpinMethod, Stage
from .stages import filter, flow, logo, rate, surface, track

if TYPE_CHECKING:
    from .spin.contrast import ContrastParameters
    from .spin.parameters import SpinParameters
    from .spin.trajectory.stage import TrajectoryParameters
    from .stages.track_parameters import TrackParameters

STAGES: Registry[Stage] = Registry("stage")
for _stage in (
    filter.STAGE,
    surface.STAGE,
    track.STAGE,
    logo.STAGE,
    rate.STAGE,
    flow.STAGE,
    triplet.STAGE,
    normal_flow.STAGE,
    contrast.STAGE,
    trajectory.STAGE,
    combined.STAGE,
    *rivals.STAGES,
):
    STAGES.register(_stage)


class Parameters(ParameterSet):
    """Everything that can be set: camera, ball, and one group for each stage; the defaults are ours."""

    if TYPE_CHECKING:  # the groups of the stages above, for type checkers; others are found all the same
        camera: CameraParameters
        ball: BallParameters
        filter: filter.FilterParameters
        surface: surface.SurfaceParameters
        track: TrackParameters
        logo: logo.LogoParameters
        rate: rate.RateParameters
        flow: flow.FlowParameters
        spin: SpinParameters
        contrast: ContrastParameters
        trajectory: TrajectoryParameters

    @classmethod
    def group_types(cls) -> dict[str, type[ParameterGroup]]:
        """Class of each group by name: camera and ball, then by stage."""
        types: dict[str, type[ParameterGroup]] = {"camera": CameraParameters, "ball": BallParameters}
        for stage in STAGES:
            types.setdefault(stage.group, stage.parameters)
        return types


def methods() -> tuple[SpinMethod, ...]:
    """The spin methods, in the order of registration."""
    return tuple(stage for stage in STAGES if isinstance(stage, SpinMethod))


def rival_methods() -> tuple[SpinMethod, ...]:
    """The methods of other publications among them."""
    return tuple(method for method in methods() if method.is_rival)


def default_stages(rivals: Iterable[str] = ()) -> tuple[str, ...]:
    """Names of all stages but the rivals, and of these rivals; raises ParameterError for an unknown rival."""
    known = [method.name for method in rival_methods()]
    asked = tuple(dict.fromkeys(rivals))
    for name in asked:
        if name not in known:
            raise ParameterError(f"there is no rival {name!r}{did_you_mean(name, known)}")
    return tuple(name for name in STAGES.names if name not in known or name in asked)


def needed_stages(targets: Iterable[str]) -> tuple[Stage, ...]:
    """The stages that must run to give these stages' results, in the order of the chain; raises ParameterError."""
    needed: set[str] = set()

    def add(name: str) -> None:
        name = "track" if name == "ball" else name
        if name != "packet" and name not in needed:
            needed.add(name)
            stage = STAGES[name]
            for other in (*stage.inputs, *(("ball",) if stage.scope == "ball" else ())):
                add(other)

    for target in targets:
        add(target)
    return tuple(stage for stage in STAGES if stage.name in needed)


def trusted_method(estimates: Mapping[str, SpinEstimate], doubt: str | None = None) -> str | None:
    """Name of the method whose estimate the program itself trusts; None where it trusts none.

    The methods are asked from the last registered to the first, for the most accurate one comes last, and then those
    that are a last resort.

    Parameters
    ----------
    estimates : Mapping[str, SpinEstimate]
        Of the methods that were run, by name.
    doubt : str, optional
        What speaks against the ball's track (`TrackEvidence.doubt`); then no estimate from it is trusted.
    """
    if doubt is not None:
        return None
    return next((method.name for method in _asked(estimates) if method.is_trusted(estimates)), None)


def distrust_reason(estimates: Mapping[str, SpinEstimate], doubt: str | None = None) -> str | None:
    """Reason for trusting no estimate, in words for people; None where one is. See `trusted_method`.

    Without doubt about the track the reasons are the methods' own refusals: that of the most accurate one, and
    those of a last resort.
    """
    if doubt is not None or trusted_method(estimates) is not None:
        return doubt
    refused = [method for method in _asked(estimates) if estimates[method.name].reason is not None]
    reasons = [f"{m.label}: {estimates[m.name].reason}" for m in refused if m is refused[0] or m.is_last_resort]
    return "; ".join(reasons) or "the methods that were run answer, but are not sure enough to be trusted alone"


def _asked(estimates: Mapping[str, SpinEstimate]) -> list[SpinMethod]:
    """The methods that were run and may be trusted, in the order in which they are asked."""
    run = [method for method in reversed(methods()) if method.name in estimates and not method.is_rival]
    return sorted(run, key=lambda method: method.is_last_resort)


def quick_stages() -> tuple[str, ...]:
    """Names of the stages that are neither slow nor need a slow one: what an interactive run shows first."""
    return tuple(name for name in default_stages() if not any(needed.is_slow for needed in needed_stages([name])))
