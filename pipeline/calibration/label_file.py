"""File of labels that somebody goes through: each change is on the disk at once, and none is lost to another."""

from __future__ import annotations

import hashlib
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import ParameterError
from .ball_labels import MOVED, BallLabels, label_bytes

# 1 sigma of a circle that is placed by eye on the outline of the middle of the exposure: its steps are of half a pixel.
HAND_STD_PX = 0.5


class LabelFile:
    """Labels in a file, as `spinscope label` writes it.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()

    def read(self) -> tuple[BallLabels, str]:
        """The labels, and the version of the file; raises RecordingError."""
        content = label_bytes(self.path)
        return BallLabels.of_csv(content, self.path), hashlib.sha256(content).hexdigest()

    def splice(self, version: str, first: int, removed: int, others: BallLabels) -> str:
        """Put labels in the place of others.

        Parameters
        ----------
        version : str
            Of the file that the change is of.
        first, removed : int
            Place of the first label that is taken out, and how many are.
        others : BallLabels
            Labels for that place. Those that were MOVED get the error of what is placed by hand.

        Returns
        -------
        str
            Version of the file after it.

        Raises
        ------
        ParameterError
            Another version is on the disk, no label would be left, or the labels would not be in order of time.
        RecordingError
            The file cannot be read or written.
        """
        with self._lock:
            labels, found = self.read()
            if found != version:
                raise ParameterError(f"the labels were changed elsewhere meanwhile, they are read anew: {self.path}")
            by_hand = replace(others, std_px=np.where(others.state == MOVED, HAND_STD_PX, others.std_px))
            changed = labels.spliced(first, removed, by_hand)
            if not changed.ball.size:
                raise ParameterError(f"these are the last labels: delete the file instead: {self.path}")
            order = np.lexsort((changed.t_us, changed.ball))
            if not np.array_equal(order, np.arange(order.size)):
                raise ParameterError("labels stand in order of time, flight by flight")
            changed.write(self.path)
            return self.read()[1]
