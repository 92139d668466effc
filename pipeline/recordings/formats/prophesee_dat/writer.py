"""Writer of Prophesee DAT files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....errors import RecordingError
from ..registry import RecordingContent
from .header import EVENT_BYTES, EVENT_KINDS

LAST_US = (1 << 32) - 1
FIELDS = np.dtype([("t", "<u4"), ("pixel", "<u4")])  # pixel: x 14 bits, y 14 bits, polarity 4 bits


def write_dat(path: Path, content: RecordingContent) -> None:
    """Write a new file; raises RecordingError for times that do not fit in 32 bits."""
    lines = {**content.attributes, "Version": 2, "Width": content.width_px, "Height": content.height_px}
    text = "".join(f"% {name} {' '.join(str(value).split())}\n" for name, value in lines.items())
    with open(path, "xb") as file:
        file.write(f"% Data file containing CD events\n{text}% end\n".encode() + bytes((EVENT_KINDS[1], EVENT_BYTES)))
        for batch in content.batches:
            first_us, last_us = int(batch.t_us[0]), int(batch.t_us[-1])
            if first_us < 0 or last_us > LAST_US:
                raise RecordingError(
                    f"times from {first_us} to {last_us} us do not fit in DAT, which goes from 0 to {LAST_US} us "
                    f"(71 minutes): write HDF5 (.h5) or a part (--window): {content.path}"
                )
            words = np.empty(len(batch), FIELDS)
            words["t"] = batch.t_us
            words["pixel"] = batch.on.astype(np.uint32) << 28 | batch.y_px.astype(np.uint32) << 14 | batch.x_px
            file.write(words.tobytes())
