"""Types of arrays that the kernels take and return."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Integers = NDArray[np.int64]
Pixels = NDArray[np.uint16]
Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]
# Time t_us, column x_px, row y_px and polarity on (ON = True) of n events, in order of time.
Events = tuple[Integers, Pixels, Pixels, Flags]
# The same at places between the pixels.
PlacedEvents = tuple[Integers, Floats, Floats, Flags]
