"""Shots in words of a language and in chosen units, as the page says them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from spinscope.pipeline.spin_terms import km_h, rpm

from .terms import mixture
from .texts import texts


@dataclass(frozen=True, slots=True)
class ShotWords:
    """Language and units.

    Attributes
    ----------
    language : str
        `en` or `de`.
    """

    language: Literal["en", "de"] = "en"
    spin_unit: Literal["rps", "rpm"] = "rps"
    speed_unit: Literal["km_h", "m_s"] = "km_h"

    def text(self, key: str, **values: str) -> str:
        """The text of a key, the key itself where there is none."""
        return texts()[self.language].get(key, key).format(**values)

    def spin(self, spin_rps: float | None) -> str:
        """`54 rps`, a dash where it is not known."""
        if spin_rps is None:
            return "–"
        return f"{spin_rps if self.spin_unit == 'rps' else rpm(spin_rps):.0f} {self.text(self.spin_unit)}"

    def speed(self, speed_m_s: float | None) -> str:
        """`31 km/h`, a dash where it is not known."""
        if speed_m_s is None:
            return "–"
        number = f"{km_h(speed_m_s):.0f}" if self.speed_unit == "km_h" else f"{speed_m_s:.1f}"
        return f"{number if self.language == 'en' else number.replace('.', ',')} {self.text(self.speed_unit)}"

    def name(self, name: str | None) -> str:
        """A name, translated where it is one of ours; `not named` without one."""
        return self.text("none") if name is None else self.text(name) if name in texts()["en"] else name

    def kind(self, shot: Mapping[str, Any]) -> str:
        """`topspin with some right sidespin` of a shot (row of a session); why not where its spin is not seen."""
        if shot["spin_rps"] is None:
            return f"{self.text('not_seen')}: {shot['reason'] or ''}"
        codes = kind_codes(shot)
        words = [" ".join(self.text(part) for part in code.split(" ")) for code in codes]
        if len(codes) == 3:  # the last two as one addition
            words[2] = f"{self.text('and')} {self.text(codes[2].split(' ')[1])}"
        told = f"from_{shot['told_by']}"
        return " ".join(words) + (f" ({self.text(told)})" if told in ("from_flight", "from_rhythm") else "")


def kind_codes(shot: Mapping[str, Any]) -> Sequence[str]:
    """Codes of a shot's kind, see `terms.mixture`: `in_place` without a flight, none without a spin."""
    parts = {name: shot[name] for name in ("topspin_rps", "sidespin_rps", "corkscrew_rps")}
    if shot["spin_rps"] is None:
        return []
    return ["in_place"] if None in parts.values() else mixture(parts, shot["spin_rps"])
