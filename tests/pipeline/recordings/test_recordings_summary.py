"""The one-pass summary against plain sums over all events, and hot pixels against the truth."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import NDArray

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, summary, write_recording
from spinscope.pipeline.recordings.event_counts import EventCounts, count_events, hot_pixel_counts
from tests.pipeline.recordings.test_recordings_raw import moving_edge
from tests.reference.recordings import naive_hot_pixels


@settings(max_examples=40)
@given(st.lists(st.integers(0, 9000), max_size=80), st.integers(1, 9))
def test_summary_is_what_plain_sums_say(tmp_path_factory: pytest.TempPathFactory, times: list[int], batch: int) -> None:
    path = tmp_path_factory.mktemp("summary") / "a.npz"
    t = np.sort(np.array(times, np.int64))
    n = t.size
    rng = np.random.default_rng(n)
    on = rng.integers(0, 2, n).astype(np.bool_)
    pixels = rng.integers(0, 40, (2, n)).astype(np.uint16)
    write_recording(path, EventBatch(t, pixels[0], pixels[1], on), width_px=64, height_px=48)
    recording = open_recording(path)
    whole = recording.chunks
    recording.chunks = lambda **_: whole(max_events=batch)  # type: ignore[method-assign]
    info = summary(recording)
    assert info.events == n and (info.width_px, info.height_px) == (64, 48)
    if not n:
        assert info.first_us is None and info.on_share is None and info.duration_us == 0
        return
    assert (info.first_us, info.last_us, info.duration_us) == (t[0], t[-1], t[-1] - t[0])
    assert info.on_share == on.sum() / n
    assert info.peak_rate_hz == max(Counter((t // 1000).tolist()).values()) * 1000
    assert info.mean_rate_hz == (None if t[0] == t[-1] else pytest.approx(n / (t[-1] - t[0]) * 1e6))
    assert info.triggers == 0 and set(info.damage.values()) == {0} and info.warnings == []


@settings(max_examples=60)
@given(
    arrays(np.int64, array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.sampled_from([0, 1, 9, 10, 11, 100]))
)
def test_hot_pixels_are_those_of_the_twin(pixels: NDArray[np.int64]) -> None:
    assert hot_pixel_counts(pixels) == naive_hot_pixels(pixels.tolist())


@pytest.mark.parametrize("together", [1000, 1 << 14])
def test_the_events_of_busy_pixels_are_counted(together: int) -> None:
    """Pixels with no event, one, and just below, at and above a multiple of 256."""
    wanted = np.array([[0, 1, 255, 256], [257, 511, 512, 5000]])
    y, x = (np.repeat(place.reshape(-1), wanted.reshape(-1)).astype(np.uint16) for place in np.indices(wanted.shape))
    order = np.random.default_rng(0).permutation(x.size)
    counts = EventCounts.of_sensor(4, 2)
    for first in range(0, x.size, together):
        rows = order[first : first + together]
        count_events(counts, np.arange(rows.size), x[rows], y[rows], np.ones(rows.size, np.bool_))
    assert np.array_equal(counts.pixels, wanted)


def test_summary_is_ready_for_json(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.h5", moving_edge(900), width_px=1280, height_px=720, attributes={"lens": "x"})
    found = json.loads(json.dumps(summary(open_recording(tmp_path / "a.h5")).as_dict()))
    assert {"format", "width", "height", "events", "duration_us", "on_share", "triggers", "damage"} <= set(found)
    assert found["events"] == 900 and found["width"] == 1280


@pytest.mark.parametrize("name", ["flight_mixed.h5", "spinner_ball2_side.h5", "spinner_ball3_back.h5"])
def test_hot_pixels_are_the_simulators(samples: Path, name: str) -> None:
    """The share of events from hot pixels is right within a third, and no other pixels are blamed."""
    recording = open_recording(samples / name)
    info = summary(recording)
    events, truth = recording.read(), recording.truth
    assert truth is not None
    hot = truth.label == 4
    pixels = np.unique(events.y_px[hot].astype(np.int64) * 1280 + events.x_px[hot])
    assert 0.5 * pixels.size <= info.hot_pixels <= pixels.size
    assert info.hot_share == pytest.approx(hot.mean(), rel=1 / 3)


def test_an_outline_that_keeps_firing_is_not_hot(tmp_path: Path) -> None:
    """A circle of 1 pixel with 50 events each, as of a spinner's ball, and one hot pixel away from it."""
    angle = np.linspace(0, 2 * np.pi, 400)
    circle = np.unique(np.rint(40 + 16 * np.stack([np.cos(angle), np.sin(angle)])).astype(np.uint16), axis=1)
    x, y = np.repeat(np.append(circle, [[5], [40]], axis=1), 50, axis=1).astype(np.uint16)
    t = np.arange(x.size, dtype=np.int64) * 100
    order = np.random.default_rng(0).permutation(x.size)
    write_recording(
        tmp_path / "a.npz", EventBatch(t, x[order], y[order], np.ones(x.size, np.bool_)), width_px=304, height_px=240
    )
    assert summary(open_recording(tmp_path / "a.npz")).hot_pixels == 1
