"""Units of the times in files of columns: words for them, plausibility, conversion to microseconds."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError

# Microseconds in one unit, and the words that files use for it.
UNITS_US = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
TIME_UNITS = tuple(UNITS_US)
WORDS = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "usec", "µs", "μs", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}
_SUFFIX = re.compile(r"(?P<name>.*?)(?:_|\s*[\[(]\s*)(?P<unit>[a-zµμ]+)\s*[\])]?")
# Mean rates of event cameras: from the noise of a small sensor in the dark to the fastest interface. Outside, 1000
# events or more are a sign of a wrong unit rather than of a scene.
PLAUSIBLE_HZ = (1e3, 2e8)
JUDGED_EVENTS = 1000
JUDGED_TIMES = 4  # different ones: by chance all are multiples of 1000 once in 10^12 files


def unit_of(word: object) -> str | None:
    """Unit for a word like "microseconds"; None for all that is none."""
    text = str(word).strip().lower()
    return next((unit for unit, words in WORDS.items() if text in words), None)


def split_unit(name: str) -> tuple[str, str | None]:
    """Split the name of a column from its unit: ("t", "us") for "t_us" and "t [us]", ("xs", None) for "xs"."""
    found = _SUFFIX.fullmatch(name)
    unit = unit_of(found["unit"]) if found else None
    return (found["name"], unit) if found and unit else (name, None)


def check_unit(unit: str | None) -> None:
    """Raise RecordingError for a unit that is neither None nor known."""
    if unit is not None and unit not in UNITS_US:
        raise RecordingError(f"time unit {unit!r} is unknown: give one of {', '.join(UNITS_US)}")


def microseconds(times: NDArray[Any], unit: str) -> NDArray[np.int64]:
    """Convert times (n,) to whole microseconds; floating-point ones are rounded, whole nanoseconds cut."""
    if times.dtype.kind == "f":
        return np.rint(times.astype(np.float64) * UNITS_US[unit]).astype(np.int64)
    whole = times.astype(np.int64, copy=False)
    if unit == "us":
        return whole
    return whole // 1000 if unit == "ns" else whole * int(UNITS_US[unit])


def rate_warning(unit: str, events: int, span: float) -> str | None:
    """Sentence about a mean rate that no camera has, with the option that mends it.

    Parameters
    ----------
    unit : str
        Unit that the times are taken in.
    events, span : int, float
        Number of events, and the time from the first to the last in the file's own numbers.

    Returns
    -------
    str or None
        None for a plausible rate, and for so few events that their rate tells nothing.
    """
    slowest_hz, fastest_hz = PLAUSIBLE_HZ

    def rate_hz(unit: str) -> float:
        return events / max(span * UNITS_US[unit] * 1e-6, 1e-9)

    if events < JUDGED_EVENTS or slowest_hz <= rate_hz(unit) <= fastest_hz:
        return None
    others = [other for other in UNITS_US if slowest_hz <= rate_hz(other) <= fastest_hz]
    remedy = " or ".join(f"--time-unit {other} ({rate_hz(other):.3g} a second)" for other in others)
    return (
        f"times taken as {unit} make {rate_hz(unit):.3g} events a second, which no event camera sends"
        f"{': state ' if remedy else ''}{remedy}"
    )


def is_slow_throughout(unit: str, times: NDArray[Any]) -> bool:
    """Whether times (n,) in rising order come slower than any camera's also from one to the next, by their median.

    Shots far apart, recorded without noise, are as few a second on average, but not while one lasts.
    """
    steps = np.diff(times.astype(np.float64))
    return bool(steps.size) and float(np.median(steps)) * UNITS_US[unit] * 1e-6 * PLAUSIBLE_HZ[0] > 1.0


def resolution_warning(times: NDArray[np.integer[Any]]) -> str | None:
    """Sentence about whole-number times (n,), taken as microseconds, that look like nanoseconds; None for others.

    A camera's clock counts microseconds: its times in nanoseconds are multiples of 1000. A busy scene's rate would be
    plausible in both units.
    """
    if np.any(times % 1000) or np.unique(times).size < JUDGED_TIMES:
        return None
    return (
        "times taken as us are all multiples of 1000, as a camera's are in nanoseconds: state --time-unit ns if they "
        "are, or --time-unit us if the clock counted milliseconds"
    )
