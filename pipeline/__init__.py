"""Spin of a table tennis ball from an event camera: events in, track and spin out.

The names below are the public Python API; scripts and notebooks import them as `spinscope.NAME`. No viewer, no web, no
global state; modules are loaded when a name is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import calibrate_flights as calibrate_flights
    from .api import estimate as estimate
    from .camera import Camera as Camera
    from .errors import ParameterError as ParameterError
    from .errors import RecordingError as RecordingError
    from .errors import SpinscopeError as SpinscopeError
    from .events import EventBatch as EventBatch
    from .presets import preset as preset
    from .presets import preset_names as preset_names
    from .recordings import Recording as Recording
    from .recordings import open_recording as open_recording
    from .registry import Parameters as Parameters
    from .results import SpinEstimate as SpinEstimate
    from .results import Truth as Truth
    from .session import Result as Result
    from .session import Session as Session
    from .shots import Shot as Shot
    from .simulated_recordings import simulate as simulate
    from .simulator import SimulatedRecording as SimulatedRecording

# Names of the API by the module that defines them.
_MODULES = {
    "calibrate_flights": "api",
    "estimate": "api",
    "Camera": "camera",
    "ParameterError": "errors",
    "RecordingError": "errors",
    "SpinscopeError": "errors",
    "EventBatch": "events",
    "preset": "presets",
    "preset_names": "presets",
    "Recording": "recordings",
    "open_recording": "recordings",
    "Parameters": "registry",
    "SpinEstimate": "results",
    "Truth": "results",
    "Result": "session",
    "Session": "session",
    "Shot": "shots",
    "simulate": "simulated_recordings",
    "SimulatedRecording": "simulator",
}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
