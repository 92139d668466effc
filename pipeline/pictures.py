"""Pictures of frame cameras, read from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import RecordingError
from .files import file_bytes

MOST_BYTES = 200_000_000


def grey_picture(path: Path) -> NDArray[np.uint8]:
    """(height, width) uint8 brightness of a picture (PNG, JPEG, TIFF ...); raises RecordingError."""
    import cv2

    try:
        content = file_bytes(path, MOST_BYTES)
    except OSError as error:
        raise RecordingError(f"the picture cannot be read ({error.strerror}): {path}") from error
    decoded = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE) if content else None
    if decoded is None:
        raise RecordingError(f"this is no picture, or a damaged one: {path}")
    return np.asarray(decoded, np.uint8)
