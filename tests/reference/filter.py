"""The slow twins of the filters: one dictionary entry a pixel, the definitions word by word."""

from __future__ import annotations


def supported_events(events: list[tuple[int, int, int]], within_us: int) -> list[int]:
    """Rows of the events (t_us, x_px, y_px) with an earlier one in a pixel around, that one's last and recent."""
    last: dict[tuple[int, int], int] = {}
    rows = []
    for row, (t_us, x, y) in enumerate(events):
        around = [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
        times = [last[pixel] for pixel in around if pixel in last]
        if times and t_us - max(times) <= within_us:
            rows.append(row)
        last[x, y] = t_us
    return rows


class NaiveFilter:
    """One filter with its memory of every pixel."""

    def __init__(self, mode: str, threshold_us: int) -> None:
        self.mode, self.threshold_us = mode, threshold_us
        self.last: dict[tuple[int, int], tuple[int, bool]] = {}
        self.passed_since_change: set[tuple[int, int]] = set()

    def passes(self, t_us: int, x_px: int, y_px: int, on: bool) -> bool:
        """Whether this event, the next one, passes."""
        pixel = (x_px, y_px)
        before = self.last.get(pixel)
        self.last[pixel] = (t_us, on)
        if before is None or before[1] != on:
            self.passed_since_change.discard(pixel)
        passed = self._passes(pixel, before, t_us, on)
        if passed:
            self.passed_since_change.add(pixel)
        return passed

    def _passes(self, pixel: tuple[int, int], before: tuple[int, bool] | None, t_us: int, on: bool) -> bool:
        if self.mode == "off":
            return True
        if before is None:
            return self.mode == "trail"
        pause_us, same = t_us - before[0], before[1] == on
        if self.mode == "trail":
            return not same or pause_us >= self.threshold_us
        if self.mode == "stc":
            return same and pause_us <= self.threshold_us
        return same and pause_us <= self.threshold_us and pixel not in self.passed_since_change


class NaiveFlicker:
    """Every pixel remembers all bins of its events of each polarity."""

    def __init__(self, flicker_hz: int) -> None:
        self.flicker_hz = flicker_hz
        self.bins: dict[tuple[int, int, bool], set[int]] = {}

    def is_flicker(self, t_us: int, x_px: int, y_px: int, on: bool) -> bool:
        """Whether this event, the next one, came one and two periods before, to within a bin of a sixteenth."""
        here = t_us * 16 * self.flicker_hz // 1_000_000
        seen = self.bins.setdefault((x_px, y_px, on), set())
        found = all(any(here - lag + off in seen for off in (-1, 0, 1)) for lag in (16, 32))
        seen.add(here)
        return found
