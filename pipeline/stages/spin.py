"""Spin: one estimate a method, with its uncertainty or the reason for refusing (section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

from ..camera import Setting
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet, SpinEstimate
from .flow import FlowResult
from .logo import LogoResult
from .normal_flow_spin import NormalFlowSpin
from .rate import RateResult
from .track import TrackResult
from .triplet_spin import TripletSpin

INPUTS = ("packet", "track", "logo", "rate", "flow")
METHODS = ("triplet", "normal_flow")


@dataclass(frozen=True, kw_only=True)
class SpinParameters(ParameterGroup):
    """What is asked for and what is trusted."""

    max_spin_rps: float = tunable(150.0, 1.0, 1000.0, 5.0, "rps", "highest spin looked for; bounds the flow's speed")
    window_us: int = tunable(
        500_000, 5000, 10_000_000, 5000, "us", "how far back in time the events of an estimate may lie"
    )
    magnitude_from: str = choice(
        "rate", ("rate", "flow"), "magnitude: from the event rate's rhythm where there is one, or from flow alone"
    )
    triplet_solve: str = choice("paper", ("paper", "least_squares"), "triplet: the paper's mean, or full rank")


@dataclass(frozen=True, slots=True, eq=False)
class SpinResult:
    """The estimates of these methods from the present shot so far, by name."""

    estimates: dict[str, SpinEstimate]


@dataclass(slots=True)
class State:
    """The estimators of the present shot, one a method."""

    setting: Setting
    shot: int | None = None
    triplet: TripletSpin | None = None
    normal_flow: NormalFlowSpin | None = None


def start(parameters: SpinParameters, setting: Setting) -> State:
    """No shot yet."""
    return State(setting)


def step(
    parameters: SpinParameters,
    state: State,
    packet: Packet,
    track: TrackResult,
    logo: LogoResult,
    rate: RateResult,
    flow: FlowResult,
) -> SpinResult:
    """Both methods' estimates from the present shot up to the end of this tick."""
    if not track.has_ball:
        state.shot, state.triplet, state.normal_flow = None, None, None
        reason = track.reason or "no ball"
        return SpinResult({method: SpinEstimate.refused(method, reason) for method in METHODS})
    if state.triplet is None or state.normal_flow is None or state.shot != track.shot:
        state.shot = track.shot
        state.triplet = TripletSpin(parameters, state.setting)
        state.normal_flow = NormalFlowSpin(parameters, state.setting)
    return SpinResult(
        {
            "triplet": state.triplet.estimate(packet.end_us, flow, rate),
            "normal_flow": state.normal_flow.estimate(packet.end_us, logo, flow, rate),
        }
    )
