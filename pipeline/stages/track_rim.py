"""The ball's rim between the events ahead and those behind: how far it lies outside the circle that is tracked.

The tracked circle is that of the events ahead, less `track.outline_px`. How far outside the rim these come differs: the
softer the lens and the stronger the contrast, the earlier; where the ground is nearly as bright as the ball's shaded
rim, they are those of its shading further in. The events behind tell which: what moves those ahead outwards moves those
behind inwards, and where the shading's are seen ahead, those behind still come at the rim. `track.outline_px` is found
with this rule at work (`calibrate latency --distance-m`): it holds what the events behind do not tell of a sensor and
lens.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .track_outline import Sighting

# The rim's share of a change of the distance between the events ahead and those behind, and the distance behind at
# which `track.outline_px` is 0.5, as on the other simulator's samples (-0.7 to -1.1 px). By radii on our simulator:
# grounds of albedo 0.06 to 0.8 and textured ones, thresholds of ON and OFF of 0.15 to 0.6, blur of 0.1 to 1.2 px, usual
# and slow pixels, 5 to 22 m/s (seeds 90000-90072; a line fitted to them has 0.68 and -0.85 px). On other balls, of
# radii of 6 to 92 px (seeds 90300, 90301 and 90600-90611), the radius is then 0.25 px off at most.
RIM_SHARE, USUAL_BEHIND_PX = 0.6, -0.83
# What is added is known as badly as this, 1 sigma: thresholds of OFF may be twice those of ON. So much off is the
# centre as well, by 0.3 to 0.9 px: the shading is not in the ball's middle, and moves on it with the view.
RIM_ERROR = 0.5
# Slow pixels with high thresholds tell of falling light so much later than of rising light, on weak sensors of our
# simulator (seeds 76010-76017: 25 to 93 us): the events behind then lie outside the ball by what it moves meanwhile.
LATE_BEHIND_US = 40.0
# Where the half behind gives no events at all, the light falls by less than the pixels tell: the outline ahead is one
# of the ball's shading, and the rim, which nothing shows, lies up to a fifth of the radius outside (seeds as above).
UNSEEN_ERROR = 0.15
# Where much of a ball is printed, the print's edge is taken for the outline, and the circle moves as it turns: by this
# share of the radius, 1 sigma, for each share of the events ahead that is not of the outline's polarity, beyond that of
# logos and noise. Half-painted balls of our simulator (seeds 93401, 93402, 97000, 97002): 0.14 to 0.39.
PRINT_SHARE, USUAL_MIXED = 0.2, 0.02


@dataclass(frozen=True, slots=True)
class Rim:
    """Events behind a ball, on average over its outlines that are wholly in view.

    Attributes
    ----------
    behind_px : float
        Distance of the events behind outside the outline, see `kernels.outline.distance_behind`.
    shown : float
        Share of the half behind that has events.
    mixed : float
        Share of the events ahead that is of the rarer polarity.
    distances, outlines : int
        Number of outlines behind the first, and behind the others.
    """

    behind_px: float = USUAL_BEHIND_PX
    shown: float = 1.0
    mixed: float = 0.0
    distances: int = 0
    outlines: int = 0

    def with_outline(self, sighting: Sighting) -> Rim:
        """The same with one more outline."""
        outlines, distances = self.outlines + 1, self.distances + (not math.isnan(sighting.behind_px))
        shown = self.shown + (sighting.behind - self.shown) / outlines
        rarer = min(sighting.ahead_on, 1.0 - sighting.ahead_on)
        mixed = self.mixed + (rarer - self.mixed) / outlines
        if distances == self.distances:
            return Rim(self.behind_px, shown, mixed, distances, outlines)
        behind_px = self.behind_px + (sighting.behind_px - self.behind_px) / distances
        return Rim(behind_px, shown, mixed, distances, outlines)

    def outside_px(self, speed_px_s: float) -> float:
        """Distance of the rim outside the circle that is tracked; negative inside."""
        late_px = RIM_SHARE * speed_px_s * LATE_BEHIND_US * 1e-6
        seen_px = self._seen_px
        return max(seen_px - late_px, 0.0) if seen_px > 0.0 else seen_px

    def std_px(self, radius_px: float) -> float:
        """Error of that, and of the centre (1 sigma), beyond the usual one."""
        return math.hypot(RIM_ERROR * max(self._seen_px, 0.0), UNSEEN_ERROR * (1.0 - self.shown) * radius_px)

    def unsteady_px(self, radius_px: float) -> float:
        """Error of the circle from tick to tick by a print at the rim (1 sigma)."""
        return PRINT_SHARE * max(self.mixed - USUAL_MIXED, 0.0) * radius_px

    @property
    def _seen_px(self) -> float:
        return RIM_SHARE * (self.behind_px - USUAL_BEHIND_PX)
