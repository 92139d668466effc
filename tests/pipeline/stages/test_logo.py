"""Logo: which events, with the ball where and when, and what may be the outline's."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Packet
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import logo as stage
from spinscope.pipeline.stages.filter import FilterResult
from spinscope.pipeline.stages.logo import LogoParameters, LogoResult, TurningEvents
from spinscope.pipeline.stages.track_result import BallTrack
from tests.spinning_ball import CONTEXT, known_ball

LOGO_LABEL = 2  # of the truth
FLIGHT = {"centre_m": (0.1, -0.35, 1.8), "velocity_m_s": (1.0, 8.0, -0.7)}
DISTORTED = Context(Camera.of(CameraParameters(distortion=(-0.2, 0.05, 0.001, 0.0, 0.0)), 1280, 720), 0.02, 150.0)


def around(track: BallTrack, start_us: int, end_us: int, count: int = 3000) -> Packet:
    """Events all over the square around the moving ball, between start_us and end_us."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(start_us, end_us, count))
    x, y = track.centre_px(t)
    x, y = x + rng.uniform(-25, 25, count), y + rng.uniform(-25, 25, count)
    events = EventBatch.checked(t, np.round(x), np.round(y), rng.random(count) < 0.5, width_px=1280, height_px=720)
    return Packet(1, start_us, end_us, events)


def logo_of(
    packet: Packet, track: BallTrack, *, context: Context = CONTEXT, delay_us: float = 0.0, **pads_px: float
) -> LogoResult:
    parameters = LogoParameters(delay_us=delay_us, **pads_px)
    state = stage.start(parameters, context)
    return stage.step(parameters, state, packet, FilterResult(packet.events, packet.events, packet.events), track)


@pytest.mark.parametrize("pad_px", [0.0, 2.5, 7.0])
def test_events_inside_the_ball_at_their_own_time_less_pad(pad_px: float) -> None:
    track = known_ball(10_000, **FLIGHT)
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
    track = known_ball(10_000, **FLIGHT)
    late = dataclasses.replace(track, t_us=track.t_us - 300.0, latency_us=300.0)
    packet = around(track, 5000, 10_000)
    np.testing.assert_array_equal(logo_of(packet, late).events.t_us, logo_of(packet, track).events.t_us)


def test_the_logo_is_later_than_the_outline() -> None:
    """The mask stays with the outline; the place on the ball is that of the ball so much earlier."""
    track = known_ball(10_000, **FLIGHT)
    packet = around(track, 5000, 10_000)
    late, sharp = logo_of(packet, track, delay_us=200.0), logo_of(packet, track)
    np.testing.assert_array_equal(late.events.t_us, sharp.events.t_us)
    x, y = track.centre_px(late.events.t_us - 200.0)
    np.testing.assert_array_equal(late.centre_x_px, x)
    np.testing.assert_array_equal(late.centre_y_px, y)
    moved_m = 200e-6 * np.array(FLIGHT["velocity_m_s"])
    inwards = np.hypot(late.x_px, late.y_px) < 0.8 * track.mean[4]
    shift = np.median((late.normals - sharp.normals)[inwards], axis=0) * CONTEXT.ball_radius_m
    np.testing.assert_allclose(shift[:2], moved_m[:2], atol=1e-4)


@pytest.mark.parametrize("context", [CONTEXT, DISTORTED])
@pytest.mark.parametrize("span_us", [1000, 5000, 60_000])
def test_points_and_normals_are_those_of_the_ball_at_the_events_own_time(context: Context, span_us: int) -> None:
    """The centre in space is taken as even between knots; here it is computed for every event."""
    track = known_ball(70_000, **FLIGHT, context=context, tick_us=span_us)
    packet = around(track, 70_000 - span_us, 70_000)
    result = logo_of(packet, track, context=context)
    assert len(result.events) > 300
    x, y = track.centre_px(result.events.t_us)
    centre = context.camera.ball_centre_m(x, y, np.full(x.size, track.mean[4]), context.ball_radius_m)
    off = result.points_m - context.ball_radius_m * result.normals - centre
    off -= np.sum(off * centre, axis=1, keepdims=True) * centre / np.sum(centre**2, axis=1, keepdims=True)
    assert np.linalg.norm(off, axis=1).max() < 1.2e-5  # 0.01 px
    seen = context.camera.project(result.points_m)
    assert np.abs(seen - np.stack([result.events.x_px, result.events.y_px], axis=1)).max() < 0.02
    assert np.all(np.sum(result.normals * result.points_m, axis=1) < 0)


def test_without_a_ball_there_is_nothing_and_a_coasting_ball_counts() -> None:
    track = known_ball(10_000, **FLIGHT)
    packet = around(track, 5000, 10_000)
    nothing = stage.absent(stage.LogoParameters(), "no ball")
    assert len(nothing.events) == 0 and nothing.normals.shape == (0, 3) and np.isnan(nothing.radius_px)
    coasting = logo_of(packet, dataclasses.replace(track, measured=None))
    assert len(coasting.events) == len(logo_of(packet, track).events) > 0


def test_no_events_is_no_trouble() -> None:
    packet = Packet(1, 5000, 10_000, EventBatch.empty())
    result = logo_of(packet, known_ball(10_000, **FLIGHT))
    assert len(result.events) == 0 and result.points_m.shape == (0, 3)


def test_the_outline_is_on_before_the_ball_and_off_behind_it_and_only_at_the_rim() -> None:
    track = known_ball(10_000, **FLIGHT)
    result = logo_of(around(track, 5000, 10_000), track)
    ahead = result.x_px * track.mean[2] + result.y_px * track.mean[3]
    assert result.of_outline.any()
    assert np.all((ahead > 0)[result.of_outline] == result.events.on[result.of_outline])
    assert np.hypot(result.x_px, result.y_px)[result.of_outline].min() > 0.6 * track.mean[4]
    still = known_ball(10_000)
    assert not logo_of(around(still, 5000, 10_000), still).of_outline.any()


def test_at_the_rim_only_the_polarity_turns_that_the_outline_has_not() -> None:
    track = known_ball(10_000, **FLIGHT)
    packet = around(track, 5000, 10_000)
    vx, vy = track.mean[2:4]
    x, y = track.centre_px(packet.events.t_us)
    dx, dy = packet.events.x_px - x, packet.events.y_px - y
    radius_px, distance_px = track.mean[4], np.hypot(dx, dy)
    of_bright_ball = (dx * vx + dy * vy > 0) == packet.events.on
    outline = distance_px > radius_px - 1.0
    packet = Packet(1, 5000, 10_000, packet.events[of_bright_ball | ~outline])
    kept = (of_bright_ball | ~outline).nonzero()[0]
    result = logo_of(packet, track, pad_px=4.0, rim_pad_px=1.5)
    inner = distance_px[kept] < radius_px - 4.0
    rim = ~inner & (distance_px[kept] < radius_px - 1.5)
    sure = np.zeros(len(kept), np.bool_)
    sure[inner] = ~result.of_outline
    expected = packet.events.t_us[sure | (rim & ~of_bright_ball[kept])]
    np.testing.assert_array_equal(result.turning.t_us, expected)
    assert np.sum(rim & ~of_bright_ball[kept]) > 50 and result.is_bright
    np.testing.assert_allclose(np.linalg.norm(result.turning.normals, axis=1), 1.0)


def test_over_a_ground_brighter_than_the_ball_nothing_at_the_rim_is_sure() -> None:
    track = known_ball(10_000, **FLIGHT)
    result = logo_of(around(track, 5000, 10_000), track)  # half of the events at the outline are of either polarity
    np.testing.assert_array_equal(result.turning.t_us, result.events.t_us[~result.of_outline])
    assert not result.is_bright


def test_a_fixed_balls_outline_is_silent() -> None:
    track = known_ball(10_000)
    packet = around(track, 5000, 10_000)
    result = logo_of(packet, track, fixed_rim_pad_px=-2.0)
    x, y = track.centre_px(packet.events.t_us)
    near = np.hypot(packet.events.x_px - x, packet.events.y_px - y) < track.mean[4] + 2.0
    np.testing.assert_array_equal(result.turning.t_us, packet.events.t_us[near])
    np.testing.assert_allclose(np.linalg.norm(result.turning.normals, axis=1), 1.0)
    assert len(result.turning) > len(result.events) and not result.is_bright


@pytest.mark.parametrize("name", ["flight_back", "flight_two_balls", "own/shot_slow_top"])
def test_what_is_taken_at_the_rim_is_the_logos(samples: Path, name: str) -> None:
    """By the labels of two simulators."""
    session = Session.open(samples / f"{name}.h5", Choices())
    assert session.truth is not None
    every, label = session.source.events, session.truth.label
    logo_at = {
        (int(every.t_us[k]), int(every.x_px[k]), int(every.y_px[k])) for k in np.flatnonzero(label == LOGO_LABEL)
    }
    taken, right = 0, 0
    for tick in session.ticks(("logo",), forget=("surface",)):
        if tick.track.ball is None:
            continue
        deep = set(tick.logo.events.t_us.tolist())
        turning = tick.logo.turning
        rim = np.array([t not in deep for t in turning.t_us.tolist()], np.bool_)
        # The pixel of an event is where its point on the ball is seen.
        points = _points_m(session, tick.track.ball, turning)[rim]
        seen = np.round(session.camera.project(points)).astype(int) if len(points) else np.empty((0, 2), int)
        taken += len(seen)
        right += sum((int(t), int(x), int(y)) in logo_at for t, (x, y) in zip(turning.t_us[rim], seen, strict=True))
    assert taken > 80 and right >= 0.98 * taken


def _points_m(session: Session, track: BallTrack, turning: TurningEvents) -> np.ndarray:
    centre = session.camera.ball_centre_m(
        turning.centre_x_px, turning.centre_y_px, np.full(len(turning), track.mean[4]), session.ball_radius_m
    )
    return centre + session.ball_radius_m * turning.normals


def test_how_well_the_ball_is_known_is_handed_on() -> None:
    """1 sigma of one axis, from both; of the radius; and of the velocity along one axis."""
    covariance = np.diag([0.09, 0.16, 900.0, 1600.0, 0.25])
    result = logo_of(
        Packet(1, 5000, 10_000, EventBatch.empty()), dataclasses.replace(known_ball(10_000), covariance=covariance)
    )
    assert result.position_std_px == pytest.approx(np.sqrt(0.125))
    assert result.radius_std_px == pytest.approx(0.5)
    assert result.velocity_std_px_s == pytest.approx(np.sqrt(1250.0))
    assert (result.radius_px, result.pad_px) == (pytest.approx(known_ball(10_000).mean[4]), 1.0)
    flying = logo_of(Packet(1, 5000, 10_000, EventBatch.empty()), known_ball(10_000, **FLIGHT))
    assert flying.pad_px == 2.5
