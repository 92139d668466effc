"""Encoding of pictures as PNG."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

# A fifth faster than the default on EROS surfaces and 3 times on flat pictures; with the filters, made for
# photographs, which quick compression brings along, it would take 3 times as long.
QUICK = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
ORDERS = {3: [2, 1, 0], 4: [2, 1, 0, 3]}  # OpenCV has red last


def png(image: NDArray[np.uint8]) -> bytes:
    """PNG of a grey (height, width), RGB (height, width, 3) or RGBA image; five times as fast as Pillow's."""
    ordered = image if image.ndim == 2 else image[..., ORDERS[image.shape[2]]]
    return bytes(cv2.imencode(".png", ordered, QUICK)[1])
