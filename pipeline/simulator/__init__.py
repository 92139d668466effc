"""A physically reasoned event camera in front of spinning table tennis balls, with exact truth."""

from .recipes import flight, rally, spinner
from .scene import Air, Arm, Background, Ball, Fixed, Flight, Light, Scene
from .sensor import Lens, Sensor
from .simulation import SimulatedRecording, default_camera, simulate, simulate_again
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
    "Sensor",
    "SimulatedRecording",
    "default_camera",
    "flight",
    "human_shot",
    "rally",
    "simulate",
    "simulate_again",
    "spinner",
    "thrown",
]
