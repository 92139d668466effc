"""Hours of live run: memory, threads and descriptors stay as they are."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from spinscope.pipeline.cameras import EventStream, RecentEvents, ReplayCamera
from spinscope.pipeline.live import LiveRun
from spinscope.pipeline.live_outputs import LiveStatus
from spinscope.pipeline.session import Session

SPEED, HOURS, SETTLED_S = 20.0, 2.0, 600.0  # of the recording


def resident_bytes(process: int) -> int:
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def counts(process: int) -> tuple[int, int]:
    """Threads and descriptors."""
    return len(os.listdir(f"/proc/{process}/task")), len(os.listdir(f"/proc/{process}/fd"))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_two_hours_at_twenty_times_real_time(samples: Path) -> None:
    session = Session.open(samples / "own/rally.h5")
    recording, recent = session.recording, RecentEvents()
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=SPEED, loops=True)  # type: ignore[union-attr]
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, sinks=(recent,), on_notice=on_notice),
        session.parameters,
        "normal_flow",
    )
    settled: list[list[tuple[int, int, int]]] = []
    shots = 0
    for one in run.outputs():
        if not isinstance(one, LiveStatus):
            shots += 1
            continue
        recorded_s = (run.stream.counts.end_us - session.source.start_us) * 1e-6
        if recorded_s > HOURS * 3600:
            run.stop()
        elif recorded_s > SETTLED_S:
            processes = os.getpid(), run._spins._process._process.pid
            settled.append([(resident_bytes(process), *counts(process)) for process in processes])
    assert shots > 0
    for number in range(2):
        resident, threads, descriptors = zip(*(states[number] for states in settled), strict=True)
        assert max(resident) < 1.05 * resident[0]
        # The process of the spins begins a thread with each stretch and shot, which is gone in other moments.
        tenth = len(settled) // 10
        for counted in (threads, descriptors):
            assert min(counted[-tenth:]) <= min(counted[:tenth])
