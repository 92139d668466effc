"""One opened recording, shared by all pages that look at it: its events, its overview, its clips.

The unit of work is a clip: the whole of a short recording, one shot of a long one.
"""

from __future__ import annotations

import dataclasses
import threading
from collections import OrderedDict
from collections.abc import Collection, Hashable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.chain import Chain, Tick
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.results import Truth
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.shots import ShotLog

CHAIN_BYTES = 160_000_000  # a clip's columns: eight surfaces of a flight of 100 ms
COLUMNS_KEPT = 200  # 40 settings of the logo, whose columns are small but many
CLIPS_KEPT = 2
# Full frames of a clip take less than half of that, so that A and B fit beside each other.
CLIP_FRAMES_BYTES = 75_000_000
MOST_FRAMES_BYTES = 600_000_000  # a short tick on a long clip: what a run may hold whatever else is kept
OVERVIEW_BINS = 1200  # about one a pixel of the page's width
MARGIN_US = 20_000  # shown before and after a shot
MAKE_WAY_S = 0.5
_kernels = threading.Lock()
_are_loaded = threading.Event()


@dataclass(frozen=True, slots=True, eq=False)
class Progressed:
    """One tick of a run, and the seconds that each stage needed for it (0 where it was known)."""

    tick: Tick
    seconds: dict[str, float]


@dataclass(slots=True, eq=False)
class Clip:
    """A part of the recording with the chain that runs over it; several threads may run it at once.

    lock : held while costs are noted
    cost_s : what each stage took when it was computed, by the value of what it was computed with
    """

    session: Session
    # Of the kind that a thread may take twice: an abandoned run may be cleaned up anywhere.
    lock: threading.RLock = field(default_factory=threading.RLock)
    cost_s: OrderedDict[Hashable, float] = field(default_factory=OrderedDict)

    @property
    def window_us(self) -> tuple[int, int]:
        """[start, end) of the clip, file time."""
        return self.session.source.start_us, self.session.source.end_us

    def with_parameters(self, parameters: Parameters) -> Session:
        """The clip's session with other parameters, sharing its chain."""
        return dataclasses.replace(self.session, parameters=parameters)

    def check(self, parameters: Parameters) -> None:
        """Raise ParameterError where the values do not go together, or the frames would not fit in memory."""
        source, chain = self.session.source, self.session.chain
        chain.check(parameters)
        ticks = chain.tick_count(parameters)
        if ticks * source.width_px * source.height_px > MOST_FRAMES_BYTES:
            raise ParameterError(
                f"track.tick_us = {parameters.track.tick_us} makes {ticks} frames of this clip, more than fit: "
                "take a longer tick or a shorter clip"
            )

    def run(self, parameters: Parameters, targets: Collection[str] | None = None) -> Iterator[Progressed]:
        """The clip's ticks; the run may be abandoned between two of them. Several threads may run at once.

        targets : stages whose results are wanted, see Chain.run
        """
        whole, took = dict.fromkeys(STAGES.names, 0.0), dict.fromkeys(STAGES.names, 0.0)
        try:
            for tick in self.session.chain.run(parameters, targets, seconds=took):
                for stage, seconds in took.items():
                    whole[stage] += seconds
                yield Progressed(tick, dict(took))
                took.update(dict.fromkeys(STAGES.names, 0.0))
        finally:
            self._note_costs(parameters, whole)

    def _note_costs(self, parameters: Parameters, took: dict[str, float]) -> None:
        """Add what the stages took, once a run: comparing keys takes a tenth of a tick."""
        keys = self.keys(parameters)
        with self.lock:
            for stage, seconds in took.items():
                if seconds:
                    self.cost_s[keys[stage]] = self.cost_s.pop(keys[stage], 0.0) + seconds
            while len(self.cost_s) > 1000:
                self.cost_s.popitem(last=False)

    def keys(self, parameters: Parameters) -> dict[str, Hashable]:
        """What each stage's results are made from, compared by value."""
        return self.session.chain.keys(parameters)

    def knows(self, parameters: Parameters, stages: Collection[str]) -> bool:
        """Whether these stages' results are all there."""
        return all(self.session.chain.knows(parameters, stage) for stage in stages)

    def cost_of(self, parameters: Parameters) -> dict[str, float]:
        """Seconds each stage took with these parameters when it was computed; absent where it never was."""
        with self.lock:
            keys = self.keys(parameters)
            return {stage: self.cost_s[key] for stage, key in keys.items() if key in self.cost_s}


class Bench:
    """A recording on the bench.

    session : as opened: all events of the window, the parameters chosen on the command line
    original : the recording it goes back to: itself, or the one whose scene was simulated again
    found : [start, end) in us of the shots of a long recording found so far, in order of time
    """

    def __init__(self, session: Session, choices: Choices, original: Path) -> None:
        self.session = session
        self.choices = choices
        self.original = original
        self.found: list[tuple[int, int]] = []
        self._pages_at_work = 0
        self._is_quiet = threading.Event()
        self._is_quiet.set()
        self._clips: OrderedDict[tuple[int, int], Clip] = OrderedDict()
        self._lock = threading.Lock()

    @classmethod
    def open(cls, path: Path, choices: Choices, original: Path | None = None) -> Bench:
        """Open a recording and read it once; raises SpinscopeError."""
        return cls(Session.open(path, choices), choices, original or path)

    @property
    def is_taken_again(self) -> bool:
        """Whether the scene was simulated again, with other biases than the original's."""
        return self.session.recording.path != self.original

    @property
    def are_kernels_loaded(self) -> bool:
        """Whether the compiled kernels are in memory."""
        return _are_loaded.is_set()

    def load_kernels(self) -> None:
        """Have the compiled kernels in memory, once a process, so that no stage's milliseconds hold their loading."""
        with _kernels:
            if not _are_loaded.is_set():
                with suppress(Exception):  # a stage that raises is told of by the run that is wanted
                    self.clip(*self.first_clip_us()).session.load_kernels()
                _are_loaded.set()

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """While somebody waits for a picture: what runs in the background makes way."""
        with self._lock:
            self._pages_at_work += 1
            self._is_quiet.clear()
        try:
            yield
        finally:
            with self._lock:
                self._pages_at_work -= 1
                if not self._pages_at_work:
                    self._is_quiet.set()

    def make_way(self) -> None:
        """Called between two pieces of background work: waits while somebody waits for a picture, not for ever."""
        self._is_quiet.wait(MAKE_WAY_S)

    @property
    def window_us(self) -> tuple[int, int]:
        """[start, end) of what was opened, file time."""
        return self.session.source.start_us, self.session.source.end_us

    @property
    def truth(self) -> Truth | None:
        """The simulator's truth, if the recording carries it."""
        return self.session.truth

    @property
    def longest_us(self) -> int:
        """The longest clip whose full frames may be held."""
        source, tick_us = self.session.source, self.session.parameters.track.tick_us
        return max(CLIP_FRAMES_BYTES // (source.width_px * source.height_px), 1) * tick_us

    @property
    def is_long(self) -> bool:
        """Whether it is worked on shot by shot."""
        start_us, end_us = self.window_us
        return end_us - start_us > self.longest_us

    def clip(self, start_us: int, end_us: int) -> Clip:
        """The part [start_us, end_us) as a clip; raises ParameterError when it is none, or too long."""
        first, last = self.window_us
        if not first <= start_us < end_us <= last:
            raise ParameterError(
                f"the clip {start_us} to {end_us} us is no part of the recording: {first} to {last} us"
            )
        if end_us - start_us > self.longest_us:
            raise ParameterError(
                f"the clip {start_us} to {end_us} us is longer than {self.longest_us / 1e6:.2f} s: choose a shorter one"
            )
        with self._lock:
            key = start_us, end_us
            clip = self._clips.pop(key, None) or self._new_clip(start_us, end_us)
            self._clips[key] = clip
            while len(self._clips) > CLIPS_KEPT:
                self._clips.popitem(last=False)
            return clip

    def _new_clip(self, start_us: int, end_us: int) -> Clip:
        return Clip(self.session.clip(start_us, end_us, budget_bytes=CHAIN_BYTES, max_columns=COLUMNS_KEPT))

    def first_clip_us(self) -> tuple[int, int]:
        """Where work starts: all of a short recording, the busiest part of a long one, which mostly is a shot."""
        start_us, end_us = self.window_us
        if not self.is_long:
            return start_us, end_us
        counts, edges_us = self.rate(OVERVIEW_BINS)
        middle = int(edges_us[int(np.argmax(counts))])
        half = min(self.longest_us, 200_000) // 2
        first = int(np.clip(middle - half, start_us, end_us - 2 * half))
        return first, first + 2 * half

    def rate(self, bins: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(n,) int64 events in bins of equal length and (n + 1,) int64 edges in us."""
        start_us, end_us = self.window_us
        edges = np.linspace(start_us, end_us, min(bins, end_us - start_us) + 1).round().astype(np.int64)
        return np.diff(np.searchsorted(self.session.source.events.t_us, edges)), edges

    def find_shots(self, parameters: Parameters) -> Iterator[float]:
        """Look for the shots of the whole recording, adding them to `found`; yields the share done, tick by tick.

        Runs the tracker and what it needs alone, and keeps nothing: a column of frames of 20 s would take 4 GB.
        """
        chain = Chain(self.session.source)
        count, log = chain.tick_count(parameters), ShotLog()
        for index, tick in enumerate(chain.run(parameters, ("track",), forget=STAGES.names)):
            log.add(tick)
            self.found = [(shot.start_us, shot.end_us) for shot in log.shots]
            yield (index + 1) / count
        log.close()
        self.found = [(shot.start_us, shot.end_us) for shot in log.shots]

    def around(self, start_us: int, end_us: int) -> tuple[int, int]:
        """The window to work on for a shot: with a margin, within the recording and not too long."""
        first, last = self.window_us
        begin = max(first, start_us - MARGIN_US)
        return begin, min(last, end_us + MARGIN_US, begin + self.longest_us)
