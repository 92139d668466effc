"""Size of the sensor: the command line's statement beats the file's, which beats a guess."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

from ..errors import RecordingError

# Resolutions of event cameras, smallest first: ATIS, DAVIS346, GenX320, Gen3/DVXplorer, Gen4/IMX636, CeleX-V,
# Samsung Gen4.
KNOWN_SENSORS = ((304, 240), (346, 260), (320, 320), (640, 480), (1280, 720), (1280, 800), (1280, 960))
# Old Prophesee RAW files state no size but the number of their camera system.
SENSOR_OF_SYSTEM_ID = {21: (640, 480), 48: (1280, 720), 49: (1280, 720)}
# 13 times as many as the largest sensor has: `info` then takes 0.3 GB, whatever size a file states.
MAX_PIXELS = 1 << 24
MAX_SIDE_PX = 8192


@dataclass(frozen=True, slots=True)
class Resolution:
    """Size of the sensor and its origin: "command line", "file", "system_ID 49" or "guess"."""

    width_px: int
    height_px: int
    origin: str


def stated_resolution(width: object, height: object, origin: str) -> Resolution:
    """Resolution from two values of the user; raises RecordingError for nonsense and for what is too large."""
    resolution = Resolution(*_size(width, height), origin)
    check_resolution(resolution)
    return resolution


def check_resolution(resolution: Resolution) -> None:
    """Raise RecordingError for a sensor that there is none of, before memory is taken for its pixels."""
    width_px, height_px = resolution.width_px, resolution.height_px
    possible = 0 < width_px <= MAX_SIDE_PX and 0 < height_px <= MAX_SIDE_PX and width_px * height_px <= MAX_PIXELS
    if not possible:
        size_px = f"{Decimal(width_px):.7g} x {Decimal(height_px):.7g}"  # thousands of digits are no float
        raise RecordingError(
            f"sensor size {size_px} from the {resolution.origin} is not 1 to {MAX_SIDE_PX} pixels each way, "
            f"{MAX_PIXELS / 1e6:.1f} million at most: state it with --sensor WxH, like --sensor 1280x720"
        )


def resolution_or_none(width: object, height: object, warnings: list[str]) -> Resolution | None:
    """Resolution from two values of a file; None with a warning added when they are no size."""
    size = _size(width, height)
    if min(size) > 0:
        return Resolution(*size, "file")
    warnings.append(f"the file's sensor size {width!s:.20} x {height!s:.20} px makes no sense: ignored")
    return None


def _size(width: object, height: object) -> tuple[int, int]:
    """Two values as whole numbers, (0, 0) where they are none."""
    try:
        return int(width), int(height)  # type: ignore[call-overload]
    except (TypeError, ValueError, OverflowError):
        return 0, 0


def geometry_or_none(text: str, warnings: list[str]) -> Resolution | None:
    """Resolution from a text like "1280x720"; None with a warning added when it is nonsense."""
    width, _, height = text.partition("x")
    return resolution_or_none(width, height, warnings)


def smallest_known(columns_px: int, rows_px: int) -> tuple[int, int] | None:
    """Width and height of the smallest known sensor with these columns and rows, None if there is none."""
    fitting = [s for s in KNOWN_SENSORS if columns_px <= s[0] and rows_px <= s[1]]
    return min(fitting, key=lambda s: s[0] * s[1]) if fitting else None
