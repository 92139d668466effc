"""Rerun's own window: where the playhead begins, and what is said without a display."""

from __future__ import annotations

import dataclasses

import pytest

from spinscope.app.viewer import require_display
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.errors import SpinscopeError

from .conftest import with_results


def test_it_opens_where_a_spin_is_first_trusted_and_the_logo_seen(flight: ViewedRun, no_ball: ViewedRun) -> None:
    trusted = [tick for tick in flight.ticks if tick.best is not None]
    first = next(tick for tick in trusted if len(tick.logo.events))
    assert flight.opening_us == first.packet.end_us > trusted[0].packet.end_us > flight.first_sight_us
    blind = dataclasses.replace(flight, ticks=[with_results(tick, logo=None) for tick in flight.ticks])
    assert blind.opening_us == trusted[0].packet.end_us
    assert no_ball.opening_us == no_ball.first_sight_us == no_ball.ticks[0].packet.end_us


def test_no_display_no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SpinscopeError, match=r"no display.*--native.*--save"):
        require_display()
