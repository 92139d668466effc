"""Rerun's own window: where the playhead begins, and what is said without a display."""

from __future__ import annotations

import pytest

from spinscope.app.viewer.native import show_native
from spinscope.app.viewer.rerun_api import playhead_request
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.errors import SpinscopeError


def test_it_opens_where_a_spin_is_first_trusted(flight: ViewedRun, no_ball: ViewedRun) -> None:
    first = next(tick for tick in flight.ticks if tick.best is not None)
    assert flight.opening_us == first.packet.end_us > flight.first_sight_us
    assert no_ball.opening_us == no_ball.first_sight_us == no_ball.ticks[0].packet.end_us


def test_the_playhead_goes_where_the_run_opens(flight: ViewedRun) -> None:
    """Decoded as protobuf: {6: {2: {1: "t"}, 3: {1: nanoseconds}, 5: 1 (paused)}}."""
    cursor = fields(fields(playhead_request(flight.opening_us))[6])
    assert fields(cursor[2]) == {1: b"t"}
    assert fields(cursor[3]) == {1: flight.opening_us * 1000}
    assert cursor[5] == 1
    negative = fields(fields(fields(playhead_request(-1))[6])[3])[1]
    assert negative == 2**64 - 1000


def fields(message: bytes) -> dict[int, bytes | int]:
    """The fields of a protobuf message, by number."""
    found: dict[int, bytes | int] = {}
    at = 0

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(message):
        key = number()
        value = number()
        if key & 7 == 2:
            found[key >> 3] = message[at : at + value]
            at += value
        else:
            found[key >> 3] = value
    return found


def test_no_display_no_window(no_ball: ViewedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SpinscopeError, match=r"no display.*--native.*--save"):
        show_native(no_ball, "all")
