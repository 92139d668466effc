"""Hours of live run: memory, threads and descriptors stay as they are."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from spinscope.pipeline.cameras import EventStream, RecentEvents, ReplayCamera
from spinscope.pipeline.live import LiveRun
from spinscope.pipeline.live_outputs import LiveStatus
from spinscope.pipeline.session import Session

SPEED, HOURS, SETTLED_S = 20.0, 2.0, 600.0  # of the recording


def resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_two_hours_at_twenty_times_real_time(samples: Path) -> None:
    hours = float(os.environ.get("SPINSCOPE_LIVE_HOURS", HOURS))
    session = Session.open(samples / "own/rally.h5")
    recording, recent = session.recording, RecentEvents()
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=SPEED, loops=True)  # type: ignore[union-attr]
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, sinks=(recent,), on_notice=on_notice),
        session.parameters,
        "normal_flow",
    )
    settled: tuple[int, int, int] | None = None
    most_bytes, shots = 0, 0
    for one in run.outputs():
        if not isinstance(one, LiveStatus):
            shots += 1
            continue
        state = resident_bytes(), threading.active_count(), len(os.listdir("/proc/self/fd"))
        recorded_s = (run.stream.counts.end_us - session.source.start_us) * 1e-6
        if settled is None and recorded_s > min(SETTLED_S, hours * 1800):
            settled = state
        if settled is not None:
            most_bytes = max(most_bytes, state[0])
            assert state[1] <= settled[1] and state[2] <= settled[2] + 1
        if recorded_s > hours * 3600:
            run.stop()
    assert settled is not None and shots > 0
    assert most_bytes < 1.05 * settled[0]
