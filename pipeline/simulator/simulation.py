"""Simulation of a scene: `simulate_scene`."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..biases import PAPER, BiasParameters
from ..camera import Camera, CameraParameters
from ..errors import ParameterError
from ..events import EventBatch
from ..results import Truth
from . import kernels, kernels_light, kernels_pixel
from .background import intensity_map
from .bodies import BallBody, Body, bodies_of
from .kernels_pixel import NOBODY
from .motion import seen, shake_px, shake_speed_px_s, triple
from .scene import Scene, built
from .segments import Segment, segments_of
from .sensor import EDGE, LOGO, OTHER, LabelledEvents, Lens, SensorModel, noise, read_out, thresholds

EDGE_STEP_PX = 0.25  # an outline moves less than this between two looks at it
LONGEST_STEP_S = 250e-6
CHUNK_ROWS = 2048  # poses held at a time
TRUTH_STEP_US = 500
DARK_FLOOR = 1e-3  # dark current as an intensity: lets the logarithm live without light
NORMALS = 1 << 16
REFERENCE_LUX = 1930.0  # the paper's setup, section 4.1
VERSION = 3  # of the model: raised whenever the same scene and seed give other events

Progress = Callable[[float, str], None]  # share done (0..1) and what is being done
BodyLooks = tuple[Body, int, int]  # a body is looked at in every so many rows; slower: see `kernels_light`


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecording:
    """Events with their truth and scene.

    Attributes
    ----------
    events : EventBatch
    truth : Truth
        Of the scene's first ball, and one label an event.
    width_px, height_px : int
        Size of the sensor.
    scene : Scene
    description : dict
        Everything that `simulate_again` needs, ready for JSON; and the segments.
    """

    events: EventBatch
    truth: Truth
    width_px: int
    height_px: int
    scene: Scene
    description: dict[str, Any]

    @property
    def camera(self) -> Camera:
        """The camera that saw the scene."""
        return built(Camera, self.description["camera"])

    @property
    def segments(self) -> list[Segment]:
        """Segments of all balls: their motions between two contacts, as far as they were in the image."""
        return [built(Segment, plain) for plain in self.description["segments"]]

    @property
    def duration_us(self) -> int:
        """Length of the scene."""
        return round(self.scene.duration_s * 1e6)

    @property
    def logo_events(self) -> int:
        """Number of the logo's events."""
        return int(np.count_nonzero(self.truth.label == LOGO))


def default_camera(width_px: int = 1280, height_px: int = 720) -> Camera:
    """The paper's camera."""
    return Camera.of(CameraParameters(), width_px, height_px)


def simulate_scene(
    scene: Scene,
    *,
    camera: Camera | None = None,
    sensor: SensorModel | BiasParameters = PAPER,
    lens: Lens | None = None,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> SimulatedRecording:
    """Simulate a scene with exact truth; the same arguments give the same events.

    Parameters
    ----------
    scene : Scene
    camera : Camera or None
        None = the paper's.
    sensor : SensorModel or BiasParameters
        A pixel array in physical units, or biases to make one from.
    lens : Lens or None
    seed : int
        Of pixel mismatch, noise and jitter; raises ParameterError when negative.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.
    """
    if seed < 0:
        raise ParameterError(f"seed {seed} is out of range: 0 or more")
    camera, lens = camera or default_camera(), lens or Lens()
    array = SensorModel.of(sensor) if isinstance(sensor, BiasParameters) else sensor
    pattern, background, pixel = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    if array.pattern_seed is not None:
        pattern = np.random.default_rng(array.pattern_seed)

    backdrop = intensity_map(scene, camera)
    work = _Simulation(scene, camera, array, lens, backdrop, pattern, pixel)
    duration_us = round(scene.duration_s * 1e6)
    moving = work.run(on_progress)
    brightness = scene.light.illuminance_lux / REFERENCE_LUX
    still = noise(array, backdrop * brightness, duration_us, camera.width_px, pattern, background)
    read = read_out([*moving, still], array, duration_us, background)
    segments = segments_of(scene, camera, [read.events.t_us[read.logo_of == ball] for ball in range(len(scene.balls))])
    description = {
        "version": VERSION,
        "seed": seed,
        "scene": scene.to_dict(),
        "camera": dataclasses.asdict(camera),
        "sensor": dataclasses.asdict(array),
        "lens": dataclasses.asdict(lens),
        "biases": sensor.as_dict() if isinstance(sensor, BiasParameters) else None,
        "segments": [dataclasses.asdict(segment) for segment in segments],
    }
    truth = truth_of(scene, camera, read.label)
    return SimulatedRecording(read.events, truth, camera.width_px, camera.height_px, scene, description)


def simulate_again(
    description: dict[str, Any],
    *,
    sensor: SensorModel | BiasParameters | None = None,
    on_progress: Progress | None = None,
) -> SimulatedRecording:
    """The recording of a description again, or the same scene with another sensor; raises ParameterError."""
    try:
        scene = Scene.from_dict(description["scene"])
        camera, lens = built(Camera, description["camera"]), built(Lens, description["lens"])
        seed = int(description["seed"])
        if sensor is None:
            biases = description.get("biases")
            sensor = SensorModel(**description["sensor"]) if biases is None else BiasParameters(**biases)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise ParameterError(f"this is no description of a simulated recording: {error!s:.200}") from error
    return simulate_scene(scene, camera=camera, sensor=sensor, lens=lens, seed=seed, on_progress=on_progress)


def truth_of(scene: Scene, camera: Camera, label: NDArray[np.uint8], ball: int = 0) -> Truth:
    """The truth of the first or another ball every 500 us of its motions."""
    times, poses = [np.empty(0, np.int64)], []
    for flown in BallBody(scene, ball).trajectories if scene.balls else ():
        first = -(-max(round(flown.start_s * 1e6), 0) // TRUTH_STEP_US) * TRUTH_STEP_US
        last = round(min(flown.end_s, scene.duration_s) * 1e6)
        times.append(np.arange(first, last, TRUTH_STEP_US, dtype=np.int64))
        poses.append(seen(flown.at(times[-1] * 1e-6), scene.shake, camera.focal_px))
    position_m, velocity_m_s, spin_rps = (
        np.concatenate([np.empty((0, 3)), *(getattr(pose, name) for pose in poses)])
        for name in ("position_m", "velocity_m_s", "spin_rps")
    )
    circle = camera.silhouette(position_m, scene.balls[ball].radius_m if scene.balls else 1.0)
    return Truth(np.concatenate(times), *circle, position_m, velocity_m_s, spin_rps, label)


class _Simulation:
    """Pixel states carried through the segments of time in which something moves in the image."""

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        sensor: SensorModel,
        lens: Lens,
        backdrop: NDArray[np.float64],
        pattern: np.random.Generator,
        random: np.random.Generator,
    ) -> None:
        self.scene, self.camera, self.lens = scene, camera, lens
        self.sensor, self.random = sensor, random
        self.bodies = bodies_of(scene)
        count = camera.width_px * camera.height_px
        on, off = thresholds(sensor, count, pattern)
        column, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        rays = camera.rays(column.ravel(), row.ravel())
        ray_x, ray_y = np.ascontiguousarray(rays[:, :2].T)
        self.view = kernels_pixel.Maps(ray_x, ray_y, backdrop, on, off, random.standard_normal(NORMALS))
        light = scene.light
        self.physics = kernels_light.Physics(
            tau_us=sensor.tau_us,
            dark_tau_us=sensor.dark_tau_us,
            forget_per_us=2 * math.pi * sensor.highpass_hz * 1e-6,
            refractory_us=sensor.dead_us,
            off_after_on_us=sensor.off_after_on_us,
            contrast_noise=sensor.contrast_noise,
            up=triple(np.array(scene.up)),
            sky=light.sky,
            bounce=light.bounce,
            brightness=light.illuminance_lux / REFERENCE_LUX,
            floor=DARK_FLOOR,
            flicker_depth=light.flicker_depth,
            flicker_per_us=2 * math.pi * light.flicker_hz * 1e-6,
            pause_us=pause_us(scene),
            focal_px=camera.focal_px,
            width_px=camera.width_px,
        )
        buffer = 4 * count if self.physics.pause_us else 1 << 20
        self.pixels = kernels_pixel.Pixels(
            state=np.zeros((count, kernels_pixel.STATE_COLUMNS)),
            role=np.full(count, kernels_pixel.NEW, np.uint8),
            owner=np.full(count, NOBODY, np.uint8),
            looked=np.full(count, -1, np.int32),
            rest=np.full(count, -1, np.int32),
            rest_body=np.zeros(count, np.uint8),
            listing=np.zeros(count, np.int32),
            cursor=np.zeros(3, np.int64),
            event_us=np.empty(buffer),
            event_word=np.empty(buffer, np.int64),
        )
        self.boxes = np.zeros((0, 4), np.int32)  # of the bodies at the end of the last segment
        self.found: list[LabelledEvents] = []

    def run(self, on_progress: Progress | None) -> list[LabelledEvents]:
        """All events of moving bodies (and flicker), delayed and jittered, not sorted."""
        end = self.scene.duration_s
        visible = [body.visible(self.camera, end) for body in self.bodies]
        edges = sorted({0.0, end, *(min(t, end) for spans in visible for span in spans for t in span)})
        for start, stop in itertools.pairwise(edges):
            middle = (start + stop) / 2
            there = [
                body for body, spans in zip(self.bodies, visible, strict=True) if any(a <= middle < b for a, b in spans)
            ]
            kernels.leave_all(self.pixels, self.boxes, self.camera.width_px)
            self.boxes = np.zeros((0, 4), np.int32)
            if there or self.pixels.cursor[0] or self.physics.pause_us:
                self._segment(there, start, stop, on_progress)
        return self.found

    def _segment(self, there: Sequence[Body], start: float, stop: float, on_progress: Progress | None) -> None:
        """Simulate [start, stop], in which these bodies and no others may be seen."""
        speeds = [body.speeds_px_s(self.camera, start, stop) for body in there]
        wanted = [min(EDGE_STEP_PX / max(surface, 1e-3), LONGEST_STEP_S) for _, surface in speeds]
        step = min(wanted, default=LONGEST_STEP_S)
        if self.physics.pause_us:
            step = min(step, self.physics.pause_us * 1e-6)
        looks: list[BodyLooks] = []
        for body, (slowest, _), own in zip(there, speeds, wanted, strict=True):
            slower = int(min(EDGE_STEP_PX / max(slowest, 1e-3), LONGEST_STEP_S) / own)
            looks.append((body, int(own / step + 1e-9), max(slower, 1)))
        rows = max(math.ceil((stop - start) / step), 1)
        if start == 0.0 and self.physics.pause_us:  # every pixel works all the time
            kernels.begin_all(self.pixels, self.view, self.physics, shake_px(self.scene.shake, [0.0])[0])
        for first in range(0, rows, CHUNK_ROWS):
            if not (there or self.pixels.cursor[0]):
                break  # everything has come to rest
            count = min(CHUNK_ROWS, rows - first)
            time_s = start + (stop - start) * np.arange(first, first + count + 1) / rows
            self.pixels.looked[:] = -1
            self.pixels.rest[:] = -1
            packed = _packed(looks, self.camera, self.lens, time_s)
            self.boxes = packed.box[-1].copy()
            shift_px = shake_px(self.scene.shake, time_s)
            row = 0 if start == 0.0 and first == 0 else 1
            while row <= count:
                row = kernels.run(self.pixels, self.view, packed, self.physics, time_s * 1e6, shift_px, row, row == 0)
                self._collect()
            if on_progress is not None:
                on_progress(min(float(time_s[-1]) / self.scene.duration_s, 1.0), "simulating")

    def _collect(self) -> None:
        pixels, sensor = self.pixels, self.sensor
        count = int(pixels.cursor[1])
        pixels.cursor[1] = 0
        late = sensor.delay_us + sensor.jitter_us * self.random.standard_normal(count)
        word = pixels.event_word[:count]
        y, x = np.divmod(word >> 16, self.camera.width_px)
        # A delay is never negative: jitter beyond that is cut.
        t_us = np.floor(pixels.event_us[:count] + np.maximum(late, 0.0)).astype(np.int64)
        owner, logo, on = (word >> 8) & 0xFF, word & 2 > 0, word & 1 > 0
        label = np.where(owner > 0, OTHER, np.where(logo, LOGO, EDGE)).astype(np.uint8)
        logo_of = np.where(logo, owner, NOBODY).astype(np.uint8)
        self.found.append(
            LabelledEvents(EventBatch(t_us, x.astype(np.uint16), y.astype(np.uint16), on), label, logo_of)
        )


def pause_us(scene: Scene) -> float:
    """Time between two looks at pixels that work all the time, 0 where they may rest.

    Forty looks a period are enough for the sine of a flicker; under a shake the image moves by EDGE_STEP_PX at most.
    """
    pauses = []
    if scene.light.flicker_depth:
        pauses.append(1e6 / (40 * scene.light.flicker_hz))
    if scene.shake.amplitude_px:
        pauses.append(1e6 * EDGE_STEP_PX / shake_speed_px_s(scene.shake))
    return min(pauses, default=0.0)


def _packed(
    looks: Sequence[BodyLooks], camera: Camera, lens: Lens, time_s: NDArray[np.float64]
) -> kernels_light.Bodies:
    """The bodies at these times in the kernels' form, from far to near."""
    middle_s = float(time_s[time_s.size // 2])
    looks = sorted(looks, key=lambda look: -look[0].distance_m(middle_s))
    packed = [body.packed(camera, lens, time_s, every, slower) for body, every, slower in looks]
    side = max((body.texture.shape[0] for body in packed), default=2)
    texture = np.zeros((len(packed), side, side), np.float32)
    pose = np.empty((time_s.size, len(packed), kernels_light.POSE_COLUMNS))
    box = np.empty((time_s.size, len(packed), 4), np.int32)
    kind = np.empty((len(packed), kernels_light.BODY_COLUMNS))
    for k, body in enumerate(packed):
        pose[:, k], box[:, k], kind[k] = body.pose, body.box, body.kind
        texture[k, : body.texture.shape[0], : body.texture.shape[1]] = body.texture
    return kernels_light.Bodies(pose, box, kind, texture)
