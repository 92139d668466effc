"""The paper's ball thrower (supplement, table of ground truth) and shots of people."""

from __future__ import annotations

import math

import numpy as np

from ..camera import Camera
from ..errors import ParameterError
from .scene import Scene
from .scenes import flight

# Velocity setting -> metres per second (section 4.3).
THROWER_SPEED_M_S = {10: 4.0, 15: 5.5, 20: 7.5, 25: 9.0}

_SETTINGS = range(-5, 8)


def _row(*values: float) -> dict[int, float]:
    return dict(zip(_SETTINGS, values, strict=False))


# Magnitudes in rps by velocity setting and spin setting; settings the paper could not measure are absent.
THROWER_SIDE_RPS = {
    25: _row(137.81, 124.60, 107.42, 103.23, 98.22, 81.83, 63.69, 38.87, 35.72, 41.38, 62.41),
    20: _row(127.10, 110.70, 92.45, 93.09, 88.47, 72.36, 60.61, 45.53, 45.40, 53.64, 64.80),
    15: _row(119.51, 98.76, 81.94, 81.89, 72.69, 66.75, 63.80, 57.20, 57.48, 63.80, 68.69),
    10: _row(92.31, 74.41, 60.74, 61.23, 58.74, 57.85, 61.46, 61.80, 62.27, 65.54, 66.11),
}
THROWER_BACKTOP_RPS = {
    25: _row(111.81, 90.41, 64.34, 65.46, 53.42, 34.13, 17.01, 16.61, 35.10, 54.20, 74.14),
    20: _row(99.99, 78.42, 55.22, 53.91, 39.42, 13.30, 2.05, 22.39, 39.94, 54.05, 68.90),
    15: _row(93.11, 71.01, 47.27, 39.65, 22.80, 5.65, 4.77, 25.30, 40.17, 54.37, 62.67, 95.77),
    10: _row(72.33, 54.58, 36.46, 23.41, 9.21, 0.91, 7.41, 17.10, 25.04, 34.94, 38.67, 59.75, 88.76),
}

# Human shots: medians and 95th percentiles of spin and speed; the highest spin measured.
HUMAN_SPIN_RPS = (46.0, 120.0, 152.0)
HUMAN_SPEED_M_S = (9.0, 20.0, 30.0)  # the cap of 30 m/s is ours: a smash


def thrower_spin(velocity_setting: int, spin_setting: int, side: bool) -> tuple[float, float]:
    """(side, top) components in rps of a thrower shot, side > 0 = left, top < 0 = backspin.

    Back/top rows: magnitudes as printed; below the row's minimum we read backspin, above it topspin. Side
    rows never reach zero and look like mixed axes. Our reading: the back/top component is the back/top row's,
    the side component the side row's at setting 0 for negative settings (that reproduces the printed
    magnitudes within about 5 %) and what is left of the magnitude for the others; the magnitude is always the
    printed one. Raises ParameterError for settings that are not in the paper's table.
    """
    table = THROWER_SIDE_RPS if side else THROWER_BACKTOP_RPS
    if velocity_setting not in table or spin_setting not in table[velocity_setting]:
        raise ParameterError(
            f"velocity setting {velocity_setting} with spin setting {spin_setting} is not in the paper's table: "
            "there are velocities 10, 15, 20, 25 and spins from -5 to 5 (back/top also 6 and 7 for the slowest)"
        )
    row = THROWER_BACKTOP_RPS[velocity_setting]
    lowest = min(row, key=lambda setting: row[setting])
    top = math.copysign(row[spin_setting], spin_setting - lowest + 0.5)
    if not side:
        return 0.0, top
    magnitude = table[velocity_setting][spin_setting]
    if spin_setting < 0:
        left = THROWER_SIDE_RPS[velocity_setting][0]
        scale = magnitude / math.hypot(left, top)
        return left * scale, top * scale
    top = math.copysign(min(abs(top), magnitude), top)
    return math.sqrt(magnitude**2 - top**2), top


def thrown(
    velocity_setting: int,
    spin_setting: int,
    *,
    side: bool = False,
    ball: int | None = None,
    camera: Camera | None = None,
    seed: int = 0,
) -> Scene:
    """A shot of the paper's ball thrower: speed and spin of its settings, place and logo from the seed.

    `ball` and `camera` are as of `flight`.
    """
    left, top = thrower_spin(velocity_setting, spin_setting, side)
    random = np.random.default_rng([seed, 4])
    heading = 90.0 + float(random.normal(0, 2.0))  # a thrower repeats its direction within a few degrees
    forward = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading)), 0.0])
    up = np.array([0.0, 0.0, -1.0])
    spin = left * up + top * np.cross(up, forward)
    return flight(
        spin_rps=spin.tolist(),
        speed_m_s=THROWER_SPEED_M_S[velocity_setting],
        heading_deg=heading,
        ball=ball,
        camera=camera,
        seed=seed,
    )


def human_shot(*, ball: int | None = None, camera: Camera | None = None, seed: int = 0) -> Scene:
    """A shot as people play them: log-normal speed and spin with the published quantiles; see `flight`."""
    random = np.random.default_rng([seed, 5])
    values = []
    for median, high, cap in (HUMAN_SPIN_RPS, HUMAN_SPEED_M_S):
        sigma = math.log(high / median) / 1.645  # the standard normal's 95th percentile
        values.append(min(median * math.exp(sigma * float(random.standard_normal())), cap))
    kind = str(random.choice(["top", "back", "mixed"]))
    speed_m_s = max(values[1], 2.0)
    return flight(kind=kind, magnitude_rps=values[0], speed_m_s=speed_m_s, ball=ball, camera=camera, seed=seed)
