"""A physically reasoned event camera in front of spinning table tennis balls, with exact truth."""

from .scene import Air, Arm, Background, Ball, Fixed, Flight, Light, Scene
from .scenes import flight, rally, spinner
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
    "Scene",
    "SensorModel",
    "SimulatedRecording",
    "default_camera",
    "flight",
    "human_shot",
    "rally",
    "simulate_again",
    "simulate_scene",
    "spinner",
    "thrown",
]
