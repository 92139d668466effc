"""Events of a turning ball with a logo of rings, without a sensor model, and the track that belongs to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Circle, Packet, SpinEstimate
from spinscope.pipeline.spin import normal_flow, triplet
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import flow, logo, rate
from spinscope.pipeline.stages.filter import FilterResult
from spinscope.pipeline.stages.track_result import BallTrack, TrackResult

Floats = NDArray[np.float64]

CAMERA = Camera.of(CameraParameters(), 1280, 720)
CONTEXT = Context(CAMERA, 0.02, {"spin.max_spin_rps": 150.0})
STEP_US = 20
DEAD_US = 2000  # a pixel reports an edge once
RINGS = ((-0.5, 0.0, 0.18), (0.0, 0.0, 0.25), (0.0, 0.0, 0.12), (0.5, 0.1, 0.2))  # along, across, radius (rad)


def turns(spin_rad_s: Floats, t_s: Floats) -> Floats:
    """(n, 3, 3) rotations by the spin over these times (Rodrigues)."""
    speed = float(np.linalg.norm(spin_rad_s))
    x, y, z = spin_rad_s / speed
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = (speed * t_s)[:, None, None]
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def rings(towards: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) on the unit sphere along the edges of dark rings around `towards`, and outward directions."""
    towards = towards / np.linalg.norm(towards)
    across = np.cross(towards, [0.3, 0.9, 0.2])
    across /= np.linalg.norm(across)
    along = np.cross(across, towards)
    points, outward = [], []
    for a, b, radius in RINGS:
        middle = towards + np.tan(a) * along + np.tan(b) * across
        middle /= np.linalg.norm(middle)
        u = np.cross(middle, across)
        u /= np.linalg.norm(u)
        v = np.cross(middle, u)
        for s in np.linspace(0, 2 * np.pi, 160, endpoint=False):
            ray = np.cos(s) * u + np.sin(s) * v
            points.append(np.cos(radius) * middle + np.sin(radius) * ray)
            outward.append(np.cos(radius) * ray - np.sin(radius) * middle)
    return np.array(points), np.array(outward)


def spinning_ball(
    spin_rps: Floats,
    *,
    towards: tuple[float, float, float] = (0.0, 0.0, -1.0),
    centre_m: tuple[float, float, float] = (0.0, 0.0, 2.0),
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
    duration_us: int = 50_000,
    context: Context = CONTEXT,
) -> EventBatch:
    """Events where the rings' edges pass the middle of a pixel: OFF where a ring arrives, ON where it leaves.

    towards : where the logo points in the middle of the time; centre_m is the ball's place at time 0
    """
    t_us = np.arange(0, duration_us, STEP_US)
    points, outward = rings(np.array(towards))
    turn = turns(2 * np.pi * np.asarray(spin_rps, np.float64), (t_us - duration_us / 2) * 1e-6)
    found = []
    for now_us, rotation in zip(t_us, turn, strict=True):
        e, n = points @ rotation.T, outward @ rotation.T
        place = np.array(centre_m) + np.array(velocity_m_s) * now_us * 1e-6 + context.ball_radius_m * e
        motion = np.cross(2 * np.pi * np.asarray(spin_rps), e)
        sense = np.sum(motion * n, axis=1) / np.linalg.norm(motion, axis=1)
        pixel = context.camera.project(place)
        near = np.abs(pixel - np.round(pixel)).max(axis=1) < 0.2
        seen = (np.sum(e * place, axis=1) < 0) & (np.abs(sense) > 0.2) & near
        x, y = np.round(pixel[seen]).astype(np.int64).T
        found.append(np.stack([np.full(x.size, now_us), x, y, (sense[seen] < 0).astype(np.int64)], axis=1))
    rows = np.unique(np.concatenate(found), axis=0)
    rows = rows[np.lexsort((rows[:, 0], rows[:, 3], rows[:, 2], rows[:, 1]))]
    same = np.all(rows[1:, 1:] == rows[:-1, 1:], axis=1)
    fresh = np.concatenate([[True], ~(same & (np.diff(rows[:, 0]) < DEAD_US))])
    rows = rows[fresh]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return EventBatch(
        rows[:, 0].copy(), rows[:, 1].astype(np.uint16), rows[:, 2].astype(np.uint16), rows[:, 3].astype(np.bool_)
    )


def known_ball(
    end_us: int,
    *,
    centre_m: tuple[float, float, float] = (0.0, 0.0, 2.0),
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
    std_px: float = 0.2,
    tick_us: int = 5000,
    context: Context = CONTEXT,
) -> BallTrack:
    """The ball at the end of a tick, known exactly, without latency."""
    there = np.array(centre_m) + np.array(velocity_m_s) * np.array([[end_us - tick_us], [end_us]]) * 1e-6
    x, y, radius = context.camera.silhouette(there, context.ball_radius_m)
    per_s = 1e6 / tick_us
    mean = np.array([x[1], y[1], (x[1] - x[0]) * per_s, (y[1] - y[0]) * per_s, radius[1]])
    covariance = np.diag([std_px**2, std_px**2, 50.0**2, 50.0**2, std_px**2])
    return BallTrack(0, float(end_us), 0.0, mean, covariance, Circle(x[1], y[1], radius[1], 1.0), 0, "start")


def track_with(ball: BallTrack) -> TrackResult:
    """A tracker's result with this ball alone."""
    return TrackResult("tracking", None, ball.t_us, (ball,), None)


def known_track(end_us: int, **options: Any) -> TrackResult:
    """The tracker's result with the ball of `known_ball`."""
    return track_with(known_ball(end_us, **options))


def no_track(end_us: int) -> TrackResult:
    return TrackResult("searching", "no ball", float(end_us), (), None)


def of_shot(track: TrackResult, shot: int) -> TrackResult:
    """The same ball as another shot's."""
    return replace(track, balls=tuple(replace(ball, shot=shot) for ball in track.balls))


def packets(events: EventBatch, tick_us: int = 5000, until_us: int | None = None) -> Iterator[Packet]:
    """The events cut into ticks, from tick 0 to the last event's or to until_us."""
    for index in range(int(events.t_us[-1]) // tick_us + 1 if until_us is None else until_us // tick_us):
        start_us, end_us = index * tick_us, (index + 1) * tick_us
        yield Packet(index, start_us, end_us, events.between(start_us, end_us))


AfterTrack = tuple[logo.LogoResult, rate.RateResult, flow.FlowResult, dict[str, SpinEstimate]]


def after_track(
    ticks: list[tuple[Packet, TrackResult]],
    *,
    parameters: SpinParameters | None = None,
    flow_parameters: flow.FlowParameters | None = None,
    context: Context = CONTEXT,
) -> list[AfterTrack]:
    """What the stages of one ball make of these packets and tracks, but for contrast."""
    groups = (
        # The pad of a ball that flies, though these may stay; the tracks given know the logo's own latency.
        logo.LogoParameters(fixed_pad_px=2.5, delay_us=0.0),
        rate.RateParameters(),
        flow_parameters or flow.FlowParameters(),
        parameters or SpinParameters(),
    )
    stages = ((logo, 0), (rate, 1), (flow, 2), (triplet, 3), (normal_flow, 3))
    shot, results = None, []
    for packet, track in ticks:
        ball = track.ball
        if ball is None:
            seen, rhythm, moved, *spins = (stage.absent(groups[at], track.reason or "no ball") for stage, at in stages)
            shot = None
        else:
            if ball.shot != shot:
                shot, states = ball.shot, [stage.start(groups[at], context) for stage, at in stages]
            seen = logo.step(
                groups[0], states[0], packet, FilterResult(packet.events, packet.events, packet.events), ball
            )
            rhythm = rate.step(groups[1], states[1], packet, ball, seen)
            moved = flow.step(groups[2], states[2], packet, ball, seen, rhythm)
            spins = [
                triplet.step(groups[3], states[3], packet, moved, rhythm),
                normal_flow.step(groups[3], states[4], packet, seen, moved, rhythm),
            ]
        results.append((seen, rhythm, moved, {spin.estimate.method: spin.estimate for spin in spins}))
    return results


def errors(estimate: SpinEstimate, spin_rps: Floats) -> tuple[float, float]:
    """(magnitude error in rps, signed-axis error in degrees) of an answer."""
    assert estimate.vector_rps is not None, estimate.reason
    magnitude, true = float(np.linalg.norm(estimate.vector_rps)), float(np.linalg.norm(spin_rps))
    cosine = float(estimate.vector_rps @ np.asarray(spin_rps)) / magnitude / true
    return magnitude - true, float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
