"""Evidence of each witness, and the combined answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from ...kernels.arrays import Floats
from ...results import ReadOnlyArrays, SpinEstimate

# A witness that makes one spin three times as likely as the next speaks for it.
SPEAKS = math.log(3.0)
MOST_ODDS = 1e6  # that are told

Basis = Literal["pattern", "rhythm", "flight"]


@dataclass(frozen=True, slots=True, eq=False)
class Witness(ReadOnlyArrays):
    """One source of evidence by itself, and what it says of the combined answer.

    Attributes
    ----------
    name : str
        Stage that it comes from.
    spin_rps, covariance_rps2 : (3,) and (3, 3) float64, optional
        Its own spin; None where it tells no axis.
    magnitude_rps, magnitude_std_rps : float, optional
        Its own magnitude; None where it tells none.
    log_odds : float
        Natural logarithm of how much more likely it makes the combined spin than the next best candidate.
    """

    name: str
    spin_rps: Floats | None
    covariance_rps2: Floats | None
    magnitude_rps: float | None
    magnitude_std_rps: float | None
    log_odds: float = 0.0

    @property
    def odds(self) -> str:
        """Odds for or against the combined spin, in words; empty where they are nearly even."""
        if abs(self.log_odds) < SPEAKS:
            return ""
        odds = math.exp(min(abs(self.log_odds), math.log(MOST_ODDS)))
        return f"{odds:,.0f} : 1 {'for it' if self.log_odds > 0 else 'against it'}"

    def to_dict(self) -> dict[str, Any]:
        """The witness as `spinscope analyze` writes it, ready for JSON."""
        axis = None
        if self.spin_rps is not None and self.magnitude_rps:
            axis = (self.spin_rps / self.magnitude_rps).tolist()
        return {
            "witness": self.name,
            "magnitude_rps": self.magnitude_rps,
            "magnitude_std_rps": self.magnitude_std_rps,
            "axis": axis,
            "log_odds": self.log_odds,
        }


@dataclass(frozen=True, slots=True, eq=False)
class CombinedResult:
    """The combined estimate, and what each witness contributed.

    Attributes
    ----------
    estimate : SpinEstimate
        From the present shot so far.
    witnesses : tuple of Witness
        Those that say something, in the order of the chain.
    summary : str
        Who told what, in words; empty without an answer.
    basis : str, optional
        What names the spins to choose from: the logo's pattern, its rhythm with the flight's axis, or the flight alone;
        None where nothing does.
    """

    estimate: SpinEstimate
    witnesses: tuple[Witness, ...] = ()
    summary: str = ""
    basis: Basis | None = None
