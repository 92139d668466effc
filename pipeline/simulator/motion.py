"""Motion of balls and arms: the physics, and poses at any time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels.rotation import rotations
from .scene import Arm, Ball, Flight, Motion, Net, Quaternion, Rolling, Scene, Shake, Vector3

Floats = NDArray[np.float64]

STEP_S = 0.5e-3  # a flight bends by less than a micrometre beyond a cubic in this time
RESTITUTION = 0.89  # ball on table: the rules ask for 23 cm of rebound from 30 cm
FRICTION = 0.25  # ball on table, sliding


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion sampled at `time_s` (k,), rising; `rotation` (k, 3, 3) is ball frame -> camera frame."""

    time_s: Floats
    position_m: Floats
    velocity_m_s: Floats
    spin_rps: Floats
    rotation: Floats

    @property
    def start_s(self) -> float:
        """Time of the first state, s."""
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last state, s."""
        return float(self.time_s[-1])

    def at(self, time_s: ArrayLike) -> Trajectory:
        """The poses at these times: cubic Hermite in space, constant spin since the sample before."""
        t = np.asarray(time_s, np.float64)
        row = np.clip(np.searchsorted(self.time_s, t, side="right") - 1, 0, self.time_s.size - 2)
        length = self.time_s[row + 1] - self.time_s[row]
        s = ((t - self.time_s[row]) / length)[:, None]
        p0, p1 = self.position_m[row], self.position_m[row + 1]
        v0, v1 = self.velocity_m_s[row], self.velocity_m_s[row + 1]
        h = length[:, None]
        position = (
            (1 + 2 * s) * (1 - s) ** 2 * p0
            + s * (1 - s) ** 2 * h * v0
            + s**2 * (3 - 2 * s) * p1
            + s**2 * (s - 1) * h * v1
        )
        velocity = 6 * s * (1 - s) * (p1 - p0) / h + (1 - s) * (1 - 3 * s) * v0 + s * (3 * s - 2) * v1
        spin = self.spin_rps[row]
        turned = rotations(spin * 2 * np.pi * (t - self.time_s[row])[:, None]) @ self.rotation[row]
        return Trajectory(t, position, velocity, spin, turned)


def matrix_of(quaternion: Quaternion) -> Floats:
    """(3, 3) rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(matrix: Floats) -> Quaternion:
    """The unit quaternion (w, x, y, z), w >= 0, of a rotation matrix."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    lower = [
        [xx - yy - zz, 0, 0, 0],
        [yx + xy, yy - xx - zz, 0, 0],
        [zx + xz, zy + yz, zz - xx - yy, 0],
        [zy - yz, xz - zx, yx - xy, np.trace(matrix)],
    ]
    values, vectors = np.linalg.eigh(np.array(lower))
    x, y, z, w = vectors[:, np.argmax(values)] * (1 if vectors[3, np.argmax(values)] >= 0 else -1)
    return float(w), float(x), float(y), float(z)


def trajectory(motion: Motion, ball: Ball, scene: Scene) -> Trajectory:
    """The motion sampled over its whole time."""
    if isinstance(motion, Flight):
        return _flown(motion, ball, scene)
    time = np.array([motion.start_s, motion.end_s])
    since = (time - time[0])[:, None]
    velocity = np.array(motion.velocity_m_s if isinstance(motion, Rolling) else (0.0, 0.0, 0.0), np.float64)
    spin = np.tile(np.array(motion.spin_rps, np.float64), (2, 1))
    turn = rotations(spin * 2 * np.pi * since) @ matrix_of(motion.orientation)
    position = np.array(motion.position_m, np.float64) + since * velocity
    return Trajectory(time, position, np.tile(velocity, (2, 1)), spin, turn)


def seen(flown: Trajectory, shake: Shake, focal_px: float) -> Trajectory:
    """The trajectory in the frame of a camera that shakes; the velocity is the scene's, turned."""
    if not shake.amplitude_px:
        return flown
    turn = shake_turns(shake, flown.time_s, focal_px)
    place, velocity, spin = (
        np.einsum("nij,nj->ni", turn, value) for value in (flown.position_m, flown.velocity_m_s, flown.spin_rps)
    )
    return Trajectory(flown.time_s, place, velocity, spin, turn @ flown.rotation)


def shake_px(shake: Shake, time_s: ArrayLike) -> Floats:
    """(n, 2) float64 shift of what stands in the middle of the image."""
    weight, turn_hz, phase = _shake_sines(shake)
    angle = 2 * np.pi * turn_hz * np.asarray(time_s, np.float64)[:, None, None] + phase
    return np.asarray(shake.amplitude_px * np.sum(weight * np.sin(angle), axis=2))


def shake_turns(shake: Shake, time_s: ArrayLike, focal_px: float) -> Floats:
    """(n, 3, 3) rotations of the scene in the frame of a camera that shakes."""
    x, y = shake_px(shake, time_s).T / focal_px
    return rotations(np.stack([-y, x, np.zeros_like(x)], axis=1))


def shake_speed_px_s(shake: Shake) -> float:
    """Bound of the image's speed in its middle."""
    weight, turn_hz, _ = _shake_sines(shake)
    return float(2 * np.pi * shake.amplitude_px * np.hypot(*np.sum(weight * turn_hz, axis=1)))


def _shake_sines(shake: Shake) -> tuple[Floats, Floats, Floats]:
    """(2, 3) weights, frequencies and phases of the axes' sines."""
    random = np.random.default_rng(shake.seed)
    weight = random.uniform(0.2, 1.0, (2, 3))
    weight /= weight.sum(axis=1, keepdims=True)
    return weight, shake.frequency_hz * 2 ** random.uniform(-1, 1, (2, 3)), random.uniform(0, 2 * np.pi, (2, 3))


def _flown(flight: Flight, ball: Ball, scene: Scene) -> Trajectory:
    """Runge-Kutta of fourth order, in plain numbers: arrays of three are slower."""
    air, up = scene.air, np.array(scene.up, np.float64)
    gx, gy, gz = triple(-air.gravity_m_s2 * up)
    area = math.pi * ball.radius_m**2
    pressure = 0.5 * air.density_kg_m3 * area / ball.mass_kg
    drag = pressure * air.drag  # 1/m, times -|v| v
    per_spin = 2 * math.pi * ball.radius_m  # from spin in rps to the speed of the surface
    count = max(int(np.ceil((flight.end_s - flight.start_s) / STEP_S)), 1)
    h = (flight.end_s - flight.start_s) / count

    def acceleration(v: Vector3, w: Vector3) -> Vector3:
        (vx, vy, vz), (wx, wy, wz) = v, w
        speed = math.sqrt(vx * vx + vy * vy + vz * vz)
        brake = drag * speed
        ax, ay, az = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
        lift = pressure * per_spin * air.magnus  # times spin x v
        across = math.sqrt(ax * ax + ay * ay + az * az)
        if air.lift_max is not None and lift * across != 0:
            rising = per_spin * air.magnus * across / (speed * speed)  # coefficient of a lift that does not saturate
            lift *= air.lift_max * math.tanh(rising / air.lift_max) / rising
        return gx - brake * vx + lift * ax, gy - brake * vy + lift * ay, gz - brake * vz + lift * az

    p, v, w = flight.position_m, flight.velocity_m_s, flight.spin_rps
    rows = [(p, v, w)]
    fade = math.exp(-flight.spin_decay_hz * h)
    for _ in range(count):
        k1 = acceleration(v, w)
        k2 = acceleration(_ahead(v, k1, h / 2), w)
        k3 = acceleration(_ahead(v, k2, h / 2), w)
        k4 = acceleration(_ahead(v, k3, h), w)
        p = _ahead(_ahead(p, v, h), _ahead(_ahead(k1, k2, 1.0), k3, 1.0), h * h / 6)
        v = _ahead(v, _ahead(_ahead(k1, k4, 1.0), _ahead(k2, k3, 1.0), 2.0), h / 6)
        w = (w[0] * fade, w[1] * fade, w[2] * fade)
        if flight.bounces:
            p, v, w = _off_the_table(p, v, w, up, ball.radius_m, scene.background.height_m)
        rows.append((p, v, w))
    position, velocity, spin = (np.array(column, np.float64) for column in zip(*rows, strict=True))
    rotation = np.empty((count + 1, 3, 3))
    rotation[0] = matrix_of(flight.orientation)
    for row, turn in enumerate(rotations(2 * np.pi * h * spin[:-1])):
        rotation[row + 1] = turn @ rotation[row]
    return Trajectory(np.linspace(flight.start_s, flight.end_s, count + 1), position, velocity, spin, rotation)


def _ahead(start: Vector3, slope: Vector3, by: float) -> Vector3:
    return start[0] + by * slope[0], start[1] + by * slope[1], start[2] + by * slope[2]


def _off_the_table(
    position: Vector3, velocity: Vector3, spin: Vector3, up: Floats, radius_m: float, table_m: float
) -> tuple[Vector3, Vector3, Vector3]:
    """The state after a bounce if the ball is in the table and goes down, the same state otherwise."""
    p, v = np.array(position), np.array(velocity)
    height = table_m + float(p @ up)  # of the centre above the table
    if height >= radius_m or v @ up >= 0:
        return position, velocity, spin
    v, w = bounced(v, np.array(spin), up, radius_m)
    p = p + (radius_m - height) * up
    return triple(p), triple(v), triple(w)


def triple(vector: Floats) -> Vector3:
    """The vector (3,) as plain numbers."""
    x, y, z = (float(v) for v in vector)
    return x, y, z


def bounced(
    velocity_m_s: Floats,
    spin_rps: Floats,
    up: Floats,
    radius_m: float,
    restitution: float = RESTITUTION,
    friction: float = FRICTION,
) -> tuple[Floats, Floats]:
    """Velocity and spin after the table: restitution, and friction until the ball grips (hollow sphere).

    References
    ----------
    A. Nakashima, Y. Ogawa, Y. Kobayashi, Y. Hayakawa, "Modeling of rebound phenomenon of a rigid ball with friction and
    elastic effects", American Control Conference 2010.
    """
    omega = 2 * np.pi * spin_rps
    fall = -float(velocity_m_s @ up)
    slip = velocity_m_s + fall * up - radius_m * np.cross(omega, up)
    slip_speed = float(np.linalg.norm(slip))
    after = velocity_m_s + (1 + restitution) * fall * up
    if slip_speed == 0:
        return after, spin_rps
    # A hollow sphere (I = 2/3 m r^2) grips after a tangential change of 2/5 of the slip.
    change = -min(friction * (1 + restitution) * fall, 0.4 * slip_speed) * slip / slip_speed
    omega = omega - 1.5 / radius_m * np.cross(up, change)
    return after + change, omega / (2 * np.pi)


def arm_ends(arm: Arm, time_s: ArrayLike) -> tuple[Floats, Floats]:
    """(n, 3) places of elbow and hand in the camera frame."""
    t = np.asarray(time_s, np.float64)
    angle = arm.swing_rad * np.sin(2 * np.pi * arm.frequency_hz * t + arm.phase_rad)
    turn = rotations(angle[:, None] * np.asarray(arm.axis)[None, :])
    elbow = np.tile(np.array(arm.elbow_m, np.float64), (t.size, 1))
    return elbow, elbow + arm.length_m * (turn @ np.asarray(arm.rest, np.float64))


def tape_at(net: Net, share: float, up: Floats, time_s: ArrayLike) -> Floats:
    """(n, 3) places of the point of a net's tape at this share of its length."""
    left, right = np.array(net.left_m, np.float64), np.array(net.right_m, np.float64)
    across = np.cross(up, right - left)
    across /= np.linalg.norm(across)
    swing = np.sin(2 * np.pi * net.frequency_hz * np.asarray(time_s, np.float64) + net.phase_rad)
    return left + share * (right - left) + net.swing_m * math.sin(math.pi * share) * swing[:, None] * across
