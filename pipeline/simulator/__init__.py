"""A physically reasoned event camera in front of spinning table tennis balls, with exact truth."""

from .real_scenes import real_scene
from .scene import Air, Arm, Background, Ball, Fixed, Flight, Light, Net, Rolling, Scene, Shake
from .scene_sampler import RealScene
from .scenes import flight, rally, spinner
from .segments import Segment
from .sensor import Lens, SensorModel
from .simulation import SimulatedRecording, default_camera, simulate_again, simulate_scene
from .thrower import human_shot, thrown

__all__ = [
    "Air",
    "Arm",
    "Background",
    "Ball",
    "Fixed",
    "Flight",
    "Lens",
    "Light",
    "Net",
    "RealScene",
    "Rolling",
    "Scene",
    "Segment",
    "SensorModel",
    "Shake",
    "SimulatedRecording",
    "default_camera",
    "flight",
    "human_shot",
    "rally",
    "real_scene",
    "simulate_again",
    "simulate_scene",
    "spinner",
    "thrown",
]
