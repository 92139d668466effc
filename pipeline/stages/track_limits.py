"""Limits of what may be a ball: its radius in the image and its speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from ..camera import Camera
from ..errors import ParameterError
from ..stage import Context
from .track_outline import Sighting

# Distances of a ball whose radii are looked for unless they are stated: a table is 2.7 m long, and a camera stands
# no nearer to the players than this. The margin is for the outline, which lies outside, and for uncertain optics.
NEAREST_M, FARTHEST_M, RADIUS_MARGIN = 0.3, 6.0, 0.1
# A setting that excluded a ball is advised beyond what was seen by this share: the next sighting differs a little.
ADVISED_MARGIN = 0.1
# Smaller circles have too few pixels: noise draws them as well.
LEAST_RADIUS_PX = 3.0


def radius_range_px(camera: Camera, ball_radius_m: float) -> tuple[float, float]:
    """Smallest and largest radius that a ball can have in the image, by its size, the optics and its distance."""
    low, high = (camera.focal_px * ball_radius_m / distance_m for distance_m in (FARTHEST_M, NEAREST_M))
    low = max(low * (1 - RADIUS_MARGIN), LEAST_RADIUS_PX)
    # A ball that does not fit into the image is none that can be measured.
    largest = min(high * (1 + RADIUS_MARGIN), min(camera.width_px, camera.height_px) / 2)
    return low, max(largest, 2 * low)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of what may be a ball.

    Attributes
    ----------
    radius_min_px, radius_max_px : float
        Those stated, else those possible.
    possible_px : (float, float)
        Radii that a ball can have, see `radius_range_px`.
    speed_min_m_s, speed_max_m_s : float
        Of a ball at the distance that its radius tells.
    ball_radius_m : float
        Radius of the ball.
    """

    radius_min_px: float
    radius_max_px: float
    possible_px: tuple[float, float]
    speed_min_m_s: float
    speed_max_m_s: float
    ball_radius_m: float

    @classmethod
    def of(
        cls,
        context: Context,
        radius_min_px: float | None,
        radius_max_px: float | None,
        speed_min_m_s: float,
        speed_max_m_s: float,
    ) -> Self:
        """Limits as stated, the radii by what is possible where they are not.

        Raises ParameterError when the radii are the wrong way round.
        """
        possible = radius_range_px(context.camera, context.ball_radius_m)
        low = possible[0] if radius_min_px is None else radius_min_px
        high = possible[1] if radius_max_px is None else radius_max_px
        if low >= high:
            raise ParameterError(f"track.radius_min_px = {low:g} must be below track.radius_max_px = {high:g}")
        return cls(low, high, possible, speed_min_m_s, speed_max_m_s, context.ball_radius_m)

    @property
    def speed_max_radii_s(self) -> float:
        """Largest speed in radii a second, the same at any distance."""
        return self.speed_max_m_s / self.ball_radius_m

    def excluding(self, sighting: Sighting) -> str | None:
        """The setting that excludes this outline, and the value that admits it, in words; None within the limits."""
        radius_px = float(sighting.ring[4])
        speed_m_s = sighting.speed_px_s / radius_px * self.ball_radius_m
        what = f"a circle of radius {radius_px:.3g} px"
        for name, value, limit in (
            ("radius_min_px", radius_px, self.radius_min_px),
            ("radius_max_px", radius_px, self.radius_max_px),
            ("speed_min_m_s", speed_m_s, self.speed_min_m_s),
            ("speed_max_m_s", speed_m_s, self.speed_max_m_s),
        ):
            sign, other = (1, "more") if "max" in name else (-1, "less")
            if sign * value > sign * limit:
                moves = f"moves at {value:.3g} m/s" if name.startswith("speed") else "moves like a ball"
                advised = f"{value * (1 + sign * ADVISED_MARGIN):.2g} or {other} admits it"
                return f"{what} {moves}, track.{name} = {limit:g} excludes it: {advised}"
        return None
