"""Drawings of runs, made in threads and kept: drawn again is only what shows results that changed."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

from .drawers import Drawer, drawers_of
from .rerun_api import Chunk
from .run import ViewedRun

KEPT_BYTES = 90_000_000  # some thirty settings of a flight of 100 ms


class DrawingCache:
    """Chunks by drawer and by the results that they show; shared by threads.

    Parameters
    ----------
    budget_bytes : int
        Above this many bytes the drawings that were not asked for longest are dropped.
    """

    def __init__(self, budget_bytes: int = KEPT_BYTES) -> None:
        self._budget_bytes = budget_bytes
        self._drawings: OrderedDict[Hashable, Future[list[Chunk]]] = OrderedDict()
        self._sizes: dict[Hashable, int] = {}
        self._lock = threading.Lock()
        self._threads = ThreadPoolExecutor(2, "drawing")

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown(cancel_futures=True)

    def begin(self, run: ViewedRun, keys: Mapping[str, Hashable]) -> None:
        """Draw what is known already of a run whose last stages are still to come, while they are computed."""
        for drawer in drawers_of(run):
            if drawer.stage is not None:
                self._drawn(drawer, run, keys)

    def chunks(self, run: ViewedRun, keys: Mapping[str, Hashable]) -> list[Chunk]:
        """Everything there is to see of a run.

        Parameters
        ----------
        run : ViewedRun
            The run.
        keys : Mapping[str, Hashable]
            Each stage's key (`Chain.keys`): equal keys, equal results.
        """
        # The ball and the text take longest, each in its own thread; numpy, OpenCV and Pillow let go of Python.
        last_first = [self._drawn(drawer, run, keys) for drawer in reversed(drawers_of(run))]
        return [chunk for drawn in reversed(last_first) for chunk in drawn.result()]

    def keep_budget(self) -> None:
        """Drop what was not asked for longest. For when nobody waits: the sizes take a tenth of the drawing."""
        with self._lock:
            new = [(key, one) for key, one in self._drawings.items() if key not in self._sizes and _is_made(one)]
        sizes = {key: sum(chunk.to_record_batch().nbytes for chunk in one.result()) for key, one in new}
        with self._lock:
            self._sizes |= {key: size for key, size in sizes.items() if key in self._drawings}
            total = sum(self._sizes.values())
            for old in [key for key in self._drawings if key in self._sizes][:-1]:
                if total <= self._budget_bytes:
                    break
                total -= self._sizes.pop(old)
                del self._drawings[old]

    def _drawn(self, drawer: Drawer, run: ViewedRun, keys: Mapping[str, Hashable]) -> Future[list[Chunk]]:
        shown = run.stages if drawer.stage is None else (drawer.stage,)
        key = (drawer, len(run.ticks), run.followed, tuple(keys[stage] for stage in shown))
        with self._lock:
            drawn = self._drawings.get(key)
            if drawn is None or (drawn.done() and not _is_made(drawn)):
                drawn = self._drawings[key] = self._threads.submit(drawer.chunks, run)
            self._drawings.move_to_end(key)
            return drawn


def _is_made(drawing: Future[list[Chunk]]) -> bool:
    return drawing.done() and not drawing.cancelled() and drawing.exception() is None
