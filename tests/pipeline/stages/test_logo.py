"""Logo: which events, with the ball where and when, and what may be the outline's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.camera import Camera, CameraParameters, Setting
from pipeline.events import EventBatch
from pipeline.results import Packet
from pipeline.stages import logo as stage
from pipeline.stages.filter import FilterResult
from pipeline.stages.logo import LogoParameters, LogoResult
from pipeline.stages.track import TrackResult
from tests.spinning_ball import SETTING, known_track, no_track

FLIGHT = {"centre_m": (0.1, -0.35, 1.8), "velocity_m_s": (1.0, 8.0, -0.7)}
DISTORTED = Setting(Camera.of(CameraParameters(distortion=(-0.2, 0.05, 0.001, 0.0, 0.0)), 1280, 720), 0.02, 150.0)


def around(track: TrackResult, start_us: int, end_us: int, count: int = 3000) -> Packet:
    """Events all over the square around the moving ball, between start_us and end_us."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(start_us, end_us, count))
    x, y = track.centre_px(t)
    x, y = x + rng.uniform(-25, 25, count), y + rng.uniform(-25, 25, count)
    events = EventBatch.checked(t, np.round(x), np.round(y), rng.random(count) < 0.5, width_px=1280, height_px=720)
    return Packet(1, start_us, end_us, events)


def logo_of(packet: Packet, track: TrackResult, *, pad_px: float = 2.5, setting: Setting = SETTING) -> LogoResult:
    parameters = LogoParameters(pad_px=pad_px)
    state = stage.start(parameters, setting)
    return stage.step(parameters, state, packet, FilterResult(packet.events, packet.events), track)


@pytest.mark.parametrize("pad_px", [0.0, 2.5, 7.0])
def test_events_inside_the_ball_at_their_own_time_less_pad(pad_px: float) -> None:
    track = known_track(10_000, **FLIGHT)
    packet = around(track, 5000, 10_000)
    result = logo_of(packet, track, pad_px=pad_px)
    x, y = track.centre_px(packet.events.t_us)
    inside = np.hypot(packet.events.x_px - x, packet.events.y_px - y) < track.mean[4] - pad_px
    np.testing.assert_array_equal(result.events.t_us, packet.events.t_us[inside])
    np.testing.assert_array_equal(result.centre_x_px, x[inside])
    np.testing.assert_allclose(result.x_px, packet.events.x_px[inside] - x[inside], atol=1e-9)
    np.testing.assert_allclose(result.y_px, packet.events.y_px[inside] - y[inside], atol=1e-9)


def test_a_late_pixel_sees_where_the_ball_was() -> None:
    """With latency an event belongs to the ball's place that much earlier."""
    track = known_track(10_000, **FLIGHT)
    late = dataclasses.replace(track, t_us=track.t_us - 300.0, latency_us=300.0)
    packet = around(track, 5000, 10_000)
    np.testing.assert_array_equal(logo_of(packet, late).events.t_us, logo_of(packet, track).events.t_us)


@pytest.mark.parametrize("setting", [SETTING, DISTORTED])
@pytest.mark.parametrize("span_us", [1000, 5000, 60_000])
def test_points_and_normals_are_those_of_the_ball_at_the_events_own_time(setting: Setting, span_us: int) -> None:
    """The centre in space is taken as even between knots; here it is computed for every event."""
    track = known_track(70_000, **FLIGHT, setting=setting, tick_us=span_us)
    packet = around(track, 70_000 - span_us, 70_000)
    result = logo_of(packet, track, setting=setting)
    assert len(result.events) > 300
    x, y = track.centre_px(result.events.t_us)
    centre = setting.camera.ball_centre_m(x, y, np.full(x.size, track.mean[4]), setting.ball_radius_m)
    off = result.points_m - setting.ball_radius_m * result.normals - centre
    off -= np.sum(off * centre, axis=1, keepdims=True) * centre / np.sum(centre**2, axis=1, keepdims=True)
    assert np.linalg.norm(off, axis=1).max() < 1.2e-5  # 0.01 px
    seen = setting.camera.project(result.points_m)
    assert np.abs(seen - np.stack([result.events.x_px, result.events.y_px], axis=1)).max() < 0.02
    assert np.all(np.sum(result.normals * result.points_m, axis=1) < 0)


def test_without_a_ball_there_is_nothing_and_a_coasting_ball_counts() -> None:
    track = known_track(10_000, **FLIGHT)
    packet = around(track, 5000, 10_000)
    nothing = logo_of(packet, no_track(10_000))
    assert len(nothing.events) == 0 and nothing.normals.shape == (0, 3) and np.isnan(nothing.radius_px)
    coasting = logo_of(packet, dataclasses.replace(track, status="coasting"))
    assert len(coasting.events) == len(logo_of(packet, track).events) > 0


def test_no_events_is_no_trouble() -> None:
    packet = Packet(1, 5000, 10_000, EventBatch.empty())
    result = logo_of(packet, known_track(10_000, **FLIGHT))
    assert len(result.events) == 0 and result.points_m.shape == (0, 3)


def test_the_outline_is_on_before_the_ball_and_off_behind_it_and_only_at_the_rim() -> None:
    track = known_track(10_000, **FLIGHT)
    result = logo_of(around(track, 5000, 10_000), track)
    ahead = result.x_px * track.mean[2] + result.y_px * track.mean[3]
    assert result.of_outline.any()
    assert np.all((ahead > 0)[result.of_outline] == result.events.on[result.of_outline])
    assert np.hypot(result.x_px, result.y_px)[result.of_outline].min() > 0.6 * track.mean[4]
    still = known_track(10_000)
    assert not logo_of(around(still, 5000, 10_000), still).of_outline.any()
