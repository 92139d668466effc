"""Size of the sensor: the command line's statement beats the file's, which beats a guess."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import RecordingError

# Resolutions of event cameras, smallest first: ATIS, DAVIS346, GenX320, Gen3/DVXplorer, Gen4/IMX636, CeleX-V,
# Samsung Gen4.
KNOWN_SENSORS = ((304, 240), (346, 260), (320, 320), (640, 480), (1280, 720), (1280, 800), (1280, 960))
# Old Prophesee RAW files state no size but the number of their camera system.
SENSOR_OF_SYSTEM_ID = {21: (640, 480), 48: (1280, 720), 49: (1280, 720)}
MAX_SIZE_PX = 65535


@dataclass(frozen=True, slots=True)
class Resolution:
    """Size of the sensor and its origin: "command line", "file", "system_ID 49" or "guess"."""

    width_px: int
    height_px: int
    origin: str


def stated_resolution(width: object, height: object, origin: str) -> Resolution:
    """Resolution from two values of a file or of the user; raises RecordingError for nonsense."""
    try:
        size = int(width), int(height)  # type: ignore[call-overload]
    except (TypeError, ValueError, OverflowError):
        size = (0, 0)
    if not (0 < size[0] <= MAX_SIZE_PX and 0 < size[1] <= MAX_SIZE_PX):
        raise RecordingError(
            f"sensor size {width} x {height} from the {origin} is not 1 to {MAX_SIZE_PX} pixels each way: "
            "state it with --sensor WxH, like --sensor 1280x720"
        )
    return Resolution(*size, origin)


def resolution_or_none(width: object, height: object, warnings: list[str]) -> Resolution | None:
    """Resolution from two values of a file; None with a warning added when they are nonsense."""
    try:
        return stated_resolution(width, height, "file")
    except RecordingError:
        warnings.append(f"the file's sensor size {width!s:.20} x {height!s:.20} px makes no sense: ignored")
        return None


def geometry_or_none(text: str, warnings: list[str]) -> Resolution | None:
    """Resolution from a text like "1280x720"; None with a warning added when it is nonsense."""
    width, _, height = text.partition("x")
    return resolution_or_none(width, height, warnings)


def smallest_known(columns_px: int, rows_px: int) -> tuple[int, int] | None:
    """Width and height of the smallest known sensor with these columns and rows, None if there is none."""
    fitting = [s for s in KNOWN_SENSORS if columns_px <= s[0] and rows_px <= s[1]]
    return min(fitting, key=lambda s: s[0] * s[1]) if fitting else None
