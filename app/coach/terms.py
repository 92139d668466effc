"""Shots in the terms of coaches: kind of spin with its mixture, spin effect, clock face, confidence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

Confidence = Literal["sure", "good", "rough"]

# Names of the components after Hodges, as the hitter sees them: positive and negative.
COMPONENTS = {
    "topspin_rps": ("topspin", "backspin"),
    "sidespin_rps": ("left_sidespin", "right_sidespin"),
    "corkscrew_rps": ("right_corkscrew", "left_corkscrew"),
}
# A tenth of a usual topspin of 50 rps and more; a receiver cannot use it.
NO_SPIN_RPS = 5.0
# Shares of the whole spin from which on a second component is named. A third turns the axis by 20 degrees, as in
# spin_terms.WORTH_A_WORD; at 0.6 (37 degrees) neither of the two is the shot's kind alone.
SOME_SHARE, AND_SHARE = 1 / 3, 0.6
# A ball that rolls turns 2.21 times a second for each km/h: 1 / (3.6 x 2 pi x 0.02 m).
ROLLING_RPS_H_KM = 1 / (3.6 * 2 * math.pi * 0.020)
# Limits of the spin effect, after Spinsight's.
SPINNY, SPEEDY = 1.4, 0.4
# Stated errors (1 sigma) behind the words: share of the spin, and angle of the axis in degrees. 12 degrees is the
# largest that the combined answer allows a logo (combined.axis_std_deg).
SURE, GOOD = (0.03, 5.0), (0.10, 12.0)
# Half a revolution a second is nothing to a player, whatever share of a slow spin it is.
ALWAYS_SURE_RPS = 0.5


def mixture(components_rps: Mapping[str, float], spin_rps: float) -> list[str]:
    """Kind of a spin as codes: the main component and those worth a word, like `topspin`, `some right_sidespin`.

    Parameters
    ----------
    components_rps : mapping
        Signed `topspin_rps`, `sidespin_rps` (left is positive) and `corkscrew_rps` (right is positive).
    spin_rps : float
        Magnitude.

    Returns
    -------
    list of str
        The first is a component or `no_spin`; the others begin with `and` or `some`.
    """
    if spin_rps < NO_SPIN_RPS:
        return ["no_spin"]
    ranked = sorted(components_rps, key=lambda name: -abs(components_rps[name]))
    codes = [COMPONENTS[name][components_rps[name] < 0] for name in ranked]
    for place, name in enumerate(ranked[1:], start=1):
        share = abs(components_rps[name]) / spin_rps
        codes[place] = f"{'and' if share >= AND_SHARE else 'some'} {codes[place]}" if share >= SOME_SHARE else ""
    return [code for code in codes if code]


def spin_effect(spin_rps: float, speed_m_s: float) -> float:
    """Spin over that of a ball that rolls at the same speed (1 = rolling)."""
    return spin_rps / (ROLLING_RPS_H_KM * 3.6 * speed_m_s)


def effect_word(effect: float) -> Literal["spinny", "neutral", "speedy"]:
    """Word for a spin effect."""
    return "spinny" if effect > SPINNY else "speedy" if effect < SPEEDY else "neutral"


def clock_hours(topspin_rps: float, sidespin_rps: float) -> float:
    """Hour on the clock face, 0 <= h < 12: where spin pushes the ball, seen from behind the hitter.

    Backspin is 12:00 (up), topspin 6:00 (down), left sidespin 9:00, right sidespin 3:00.
    """
    return math.degrees(math.atan2(-sidespin_rps, -topspin_rps)) / 30 % 12


def corkscrew_share(corkscrew_rps: float, spin_rps: float) -> float:
    """Share of the spin, 0 to 1, whose axis lies along the flight and does not bend it (gyro degree)."""
    return abs(corkscrew_rps) / spin_rps if spin_rps > 0 else 0.0


def confidence(spin_rps: float, spin_std_rps: float | None, axis_std_deg: float | None) -> Confidence:
    """Word for the stated errors (1 sigma) of a trusted answer."""
    if spin_std_rps is None or axis_std_deg is None:
        return "rough"
    for word, (share, angle_deg) in (("sure", SURE), ("good", GOOD)):
        if spin_std_rps <= max(share * spin_rps, ALWAYS_SURE_RPS) and axis_std_deg <= angle_deg:
            return "sure" if word == "sure" else "good"
    return "rough"
