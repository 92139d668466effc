"""An opened recording, shared by all clients that look at it: its events, its event rate, its clips.

The unit of work is a clip: the whole of a short recording, one shot of a long one.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spinscope.app.tuning.clip_run import MOST_FRAMES_BYTES
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.session import Choices, Progress, Session
from spinscope.pipeline.shots import ShotLog

CHAIN_BYTES = 160_000_000  # a clip's columns: eight surfaces of a flight of 100 ms
COLUMNS_KEPT = 200  # 40 settings of the logo, whose columns are small but many
CLIPS_KEPT = 2
COSTS_KEPT = 1000
# Full frames of a clip take less than half of CHAIN_BYTES, so that A and B fit beside each other.
CLIP_FRAMES_BYTES = 75_000_000
# Without tools there is one setting and nothing to be kept: 8 s of the paper's sensor at 200 Hz.
VIEW_FRAMES_BYTES = 1_500_000_000
RATE_BINS = 1200  # about one for each pixel of the page's width
MARGIN_US = 20_000  # shown before and after a shot
MAKE_WAY_S = 0.5
_kernels = threading.Lock()
_are_loaded = threading.Event()


def note_loaded_kernels() -> None:
    """Take note that the compiled kernels are in memory: somebody else has loaded them."""
    _are_loaded.set()


class OpenRecording:
    """An opened recording with the clips that are worked on.

    Parameters
    ----------
    session : Session
        The events of the window, and the parameters chosen on the command line.
    choices : Choices
        What was chosen on the command line.
    original : Path
        The recording itself, or the one whose scene was simulated again.
    frames_bytes : int
        Full frames that a clip may have.

    Attributes
    ----------
    found_us : list of (int, int)
        [start, end) of the shots of a long recording found so far, in order of time.
    max_frame_bytes : int
        Full frames that a run may hold, whatever its tick.
    """

    def __init__(self, session: Session, choices: Choices, original: Path, frames_bytes: int | None = None) -> None:
        self.session = session
        self.choices = choices
        self.original = original
        self.found_us: list[tuple[int, int]] = []
        self._frames_bytes = CLIP_FRAMES_BYTES if frames_bytes is None else frames_bytes
        self.max_frame_bytes = max(MOST_FRAMES_BYTES, self._frames_bytes)
        self._clips: OrderedDict[tuple[int, int], Session] = OrderedDict()
        self._cost_s: OrderedDict[Hashable, float] = OrderedDict()
        self._runs = 0
        self._is_quiet = threading.Event()
        self._is_quiet.set()
        # Of the kind that a thread may take twice: an abandoned run may be cleaned up anywhere.
        self._lock = threading.RLock()

    @classmethod
    def open(
        cls,
        path: Path,
        choices: Choices,
        original: Path | None = None,
        frames_bytes: int | None = None,
        on_progress: Progress | None = None,
    ) -> OpenRecording:
        """Open a recording and read or index it; raises SpinscopeError."""
        return cls(Session.open(path, choices, on_progress), choices, original or path, frames_bytes)

    @property
    def is_resimulated(self) -> bool:
        """Whether the scene was simulated again, with other biases than the original's."""
        return self.session.recording.path != self.original

    @property
    def window_us(self) -> tuple[int, int]:
        """[start, end) of what was opened, file time."""
        return self.session.source.start_us, self.session.source.end_us

    @property
    def longest_us(self) -> int:
        """The longest clip whose full frames may be held."""
        source, tick_us = self.session.source, self.session.parameters.track.tick_us
        return max(self._frames_bytes // (source.width_px * source.height_px), 1) * tick_us

    @property
    def is_long(self) -> bool:
        """Whether it is worked on shot by shot."""
        start_us, end_us = self.window_us
        return end_us - start_us > self.longest_us

    def clip(self, start_us: int, end_us: int) -> Session:
        """The part [start_us, end_us) as a session of its own; raises ParameterError, see `check_clip`."""
        self.check_clip(start_us, end_us)
        with self._lock:
            key = start_us, end_us
            clip = self._clips.pop(key, None)
            if clip is None:
                clip = self.session.clip(start_us, end_us, budget_bytes=CHAIN_BYTES, max_columns=COLUMNS_KEPT)
            self._clips[key] = clip
            while len(self._clips) > CLIPS_KEPT:
                self._clips.popitem(last=False)
            return clip

    def check_clip(self, start_us: int, end_us: int) -> None:
        """Raise ParameterError where [start_us, end_us) is no part of the recording, or too long."""
        first, last = self.window_us
        if not first <= start_us < end_us <= last:
            raise ParameterError(
                f"the clip {start_us} to {end_us} us is no part of the recording: {first} to {last} us"
            )
        if end_us - start_us > self.longest_us:
            raise ParameterError(
                f"the clip {start_us} to {end_us} us is longer than {self.longest_us / 1e6:.2f} s: choose a shorter one"
            )

    def first_clip_us(self) -> tuple[int, int]:
        """First clip to work on: all of a short recording, the busiest part of a long one, which mostly is a shot."""
        start_us, end_us = self.window_us
        if not self.is_long:
            return start_us, end_us
        counts, edges_us = self.rate(RATE_BINS)
        middle = int(edges_us[int(np.argmax(counts))])
        half = min(self.longest_us, 200_000) // 2
        first = int(np.clip(middle - half, start_us, end_us - 2 * half))
        return first, first + 2 * half

    def first_clip(self) -> Session:
        """The clip with which work starts."""
        return self.clip(*self.first_clip_us())

    def rate(self, bins: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(n,) int64 events in bins of equal length and (n + 1,) int64 edges in us."""
        start_us, end_us = self.window_us
        edges = np.linspace(start_us, end_us, min(bins, end_us - start_us) + 1).round().astype(np.int64)
        return self.session.source.rate(edges), edges

    def note_costs(self, clip: Session, parameters: Parameters, seconds: Mapping[str, float]) -> None:
        """Add what the stages of a run took, by what their results are made from."""
        keys = clip.chain.keys(parameters)
        with self._lock:
            for stage, more in seconds.items():
                if more:
                    self._cost_s[keys[stage]] = self._cost_s.pop(keys[stage], 0.0) + more
            while len(self._cost_s) > COSTS_KEPT:
                self._cost_s.popitem(last=False)

    def costs_ms(self, clip: Session, parameters: Parameters) -> dict[str, float]:
        """Milliseconds that each stage took when it was computed with these parameters; absent where it never was."""
        keys = clip.chain.keys(parameters)
        with self._lock:
            return {stage: 1000 * self._cost_s[key] for stage, key in keys.items() if key in self._cost_s}

    @property
    def are_kernels_loaded(self) -> bool:
        """Whether the compiled kernels are in memory."""
        return _are_loaded.is_set()

    def load_kernels(self) -> None:
        """Have the compiled kernels in memory, once a process, so that no stage's milliseconds hold their loading."""
        with _kernels:
            if not _are_loaded.is_set():
                with suppress(Exception):  # a stage that raises is reported by the run that needs it
                    self.first_clip().load_kernels()
                _are_loaded.set()

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Mark that somebody waits for a picture: what runs in the background makes way."""
        with self._lock:
            self._runs += 1
            self._is_quiet.clear()
        try:
            yield
        finally:
            with self._lock:
                self._runs -= 1
                if not self._runs:
                    self._is_quiet.set()

    def make_way(self) -> None:
        """Wait while somebody waits for a picture, not for ever; called between two pieces of background work."""
        self._is_quiet.wait(MAKE_WAY_S)

    def find_shots(self, parameters: Parameters) -> Iterator[float]:
        """Find the shots of the whole recording, adding them to `found_us`; yields the share done, tick by tick.

        Runs the tracker and what it needs alone, and keeps nothing: a column of frames of 20 s would take 4 GB.
        """
        chain, log = Chain(self.session.source), ShotLog()
        count = chain.tick_count(parameters)
        self.found_us = []
        for index, tick in enumerate(chain.run(parameters, ("track",), forget=STAGES.names)):
            log.add(tick)
            if len(log) != len(self.found_us):
                self.found_us = [(shot.start_us, shot.end_us) for shot in log.shots]
            yield (index + 1) / count
        log.close()
        self.found_us = [(shot.start_us, shot.end_us) for shot in log.shots]
