"""Surfaces to compare EROS with, from the pixels' last events: accumulated frame, linear time surface."""

from __future__ import annotations

import numpy as np

from .arrays import Bytes, Integers

# No event yet: so long ago that no span reaches it, and no difference of times overflows.
NEVER_US = np.int64(-(1 << 62))


def render(values: Bytes, last_us: Integers, end_us: int, span_us: int, linear: bool) -> None:
    """Write the pixels with an event in [end - span, end) into `values` (height, width), which must hold zeros.

    `last_us` (height, width) is the time of each pixel's last event. The value is 255 or, if `linear`,
    255 (1 - age / span) with age = end - time, rounded half up.
    """
    start_us = end_us - span_us
    recent = last_us >= start_us
    values[recent] = 255 * (last_us[recent] - start_us) / span_us + 0.5 if linear else 255
