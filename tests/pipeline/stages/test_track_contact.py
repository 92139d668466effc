"""The change test on paths of circles: contacts found, when and of which kind, and none where there is none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Circle, Packet
from spinscope.pipeline.simulator import Ball, Flight, Scene, flight
from spinscope.pipeline.simulator.motion import Trajectory, trajectory, triple
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import track, track_contact, track_initiation
from spinscope.pipeline.stages.track_ball import TrackedBall
from spinscope.pipeline.stages.track_contact import Contact, find_contact
from spinscope.pipeline.stages.track_outline import Sighting
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_path import PathPoint
from spinscope.pipeline.stages.track_result import ShotEnd
from spinscope.pipeline.stages.track_state import Earlier

ABOVE = Camera.of(CameraParameters(), 1280, 720)
SIDE = Camera.of(CameraParameters(up=(0.0, -1.0, 0.0)), 1280, 720)
TICK_US, CONTOUR_US = 5000, 3000
# Of the outline's edge ahead, across the flight, and of the radius, on simulated flights.
NOISE_PX = np.array([0.04, 0.03, 0.06])
KINDS = ("top", "back", "left", "right", "corkscrew", "mixed")
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def path_of(flown: Trajectory, camera: Camera, rng: np.random.Generator, tick_us: int = TICK_US) -> list[PathPoint]:
    """Noisy circles of a ball at the ends of ticks, as the tracker keeps them."""
    first = math.ceil(flown.start_s * 1e6 / tick_us) + 1
    ends_us = np.arange(first * tick_us, flown.end_s * 1e6, tick_us).astype(np.int64)
    x, y, radius = camera.silhouette(flown.at(ends_us * 1e-6).position_m, 0.02)
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    ahead, across, size = (rng.standard_normal((ends_us.size, 3)) * NOISE_PX).T
    x += (ahead - size) * np.cos(heading) - across * np.sin(heading)
    y += (ahead - size) * np.sin(heading) + across * np.cos(heading)
    return [
        PathPoint(int(end), Circle(*row, 1.0), 0.005 * np.eye(3))
        for end, row in zip(ends_us, np.stack([x, y, radius + size], axis=1).tolist(), strict=True)
    ]


def first_contact(path: list[PathPoint], camera: Camera) -> Contact | None:
    """What the tracker finds, going along the path."""
    found = (find_contact(path[: n + 1], camera, 0.02, CONTOUR_US, 3) for n in range(len(path)))
    return next((contact for contact in found if contact is not None), None)


def flown(scene: Scene) -> Trajectory:
    return trajectory(scene.balls[0].motions[0], scene.balls[0], scene)


def bounce_above(seed: int) -> tuple[Trajectory, Camera]:
    rng = np.random.default_rng([seed, 1])
    scene = flight(
        kind=KINDS[seed % 6],
        magnitude_rps=float(rng.uniform(0, 80)),
        speed_m_s=float(rng.uniform(4, 9)),
        heading_deg=float(rng.uniform(0, 360)),
        bounce=True,
        seed=seed,
    )
    return flown(scene), ABOVE


def bounce_side(seed: int) -> tuple[Trajectory, Camera]:
    rng = np.random.default_rng([seed, 2])
    start = Flight(0.0, 0.15, (-0.5, -0.05, 2.0), (float(rng.uniform(3, 7)), 1.5, float(rng.uniform(-0.5, 0.5))),
                   triple(rng.uniform(-40, 40, 3)), UPRIGHT, bounces=True)  # fmt: skip
    scene = Scene(0.15, (Ball((start,)),), up=(0.0, -1.0, 0.0))
    return flown(Scene(0.15, scene.balls, background=type(scene.background)(height_m=0.15), up=scene.up)), SIDE


def hit(seed: int, at_s: float = 0.0605) -> tuple[Trajectory, Camera]:
    rng = np.random.default_rng([seed, 3])
    speed = float(rng.uniform(3, 9))
    here = Flight(0.0, at_s, (-0.4, float(rng.uniform(-0.1, 0.1)), 1.8), (speed, 0.5, 0.0), (0.0, 40.0, 0.0), UPRIGHT)
    there = flown(Scene(at_s, (Ball((here,)),)))
    back = Flight(at_s, 0.12, triple(there.position_m[-1]), (-float(rng.uniform(5, 14)), 0.5, -0.5),
                  (0.0, -60.0, 0.0), UPRIGHT)  # fmt: skip
    away = flown(Scene(0.12, (Ball((back,)),)))
    joined = (
        np.concatenate([getattr(there, name)[:-1], getattr(away, name)]) for name in Trajectory.__dataclass_fields__
    )
    return Trajectory(*joined), ABOVE


def hit_at_random(seed: int) -> tuple[Trajectory, Camera]:
    """A hit at any instant of a tick."""
    return hit(seed, float(np.random.default_rng([seed, 6]).uniform(0.055, 0.06)))


def contact_s(flown: Trajectory) -> float:
    """Time of the jump of velocity."""
    jumps = np.abs(np.diff(flown.velocity_m_s, axis=0)).max(axis=1)
    assert jumps.max() > 0.3, "no contact in the scene"
    return float(flown.time_s[int(np.argmax(jumps)) + 1])


@pytest.mark.parametrize(
    ("scene", "kind", "count"), [(bounce_above, "bounce", 50), (bounce_side, "bounce", 50), (hit, "hit", 20)]
)
def test_contacts_are_found_to_2_ms(scene: object, kind: str, count: int) -> None:
    errors_ms = []
    for seed in range(7700, 7700 + count):
        path, camera = scene(seed)  # type: ignore[operator]
        contact = first_contact(path_of(path, camera, rng_of(seed)), camera)
        assert contact is not None and contact.kind == kind
        errors_ms.append(abs(contact.time_us * 1e-3 - contact_s(path) * 1e3))
    assert np.percentile(errors_ms, 97) < 2.0
    assert max(errors_ms) < 4.0


def test_the_path_after_a_contact_is_the_balls() -> None:
    path, camera = bounce_above(7701)
    contact = first_contact(path_of(path, camera, np.random.default_rng(1)), camera)
    assert contact is not None
    later_s = contact.time_us * 1e-6 + np.array([0.004, 0.0041])
    x, y, radius = camera.silhouette(path.at(later_s).position_m, 0.02)
    state = contact.path.state(later_s[0] * 1e6)
    assert np.hypot(state[0] - x[0], state[1] - y[0]) < 1.0
    assert np.hypot(state[2] - np.diff(x)[0] * 1e4, state[3] - np.diff(y)[0] * 1e4) < 150.0
    assert abs(state[4] - radius[0]) < 0.3


def test_the_ball_that_a_racket_sends_back_is_known_at_once() -> None:
    """Its instant to 0.1 ms: at 15 m/s between both velocities that is 1.5 mm of place, a pixel and more."""
    late_ms, off_px = [], []
    for seed in range(97_300, 97_320):
        way, camera = hit_at_random(seed)
        contact = first_contact(path_of(way, camera, rng_of(seed)), camera)
        assert contact is not None
        late_ms.append(contact.path.hinge_us * 1e-3 - contact_s(way) * 1e3)
        soon_us = contact_s(way) * 1e6 + 1000.0
        x, y, _ = camera.silhouette(way.at(np.array([soon_us * 1e-6])).position_m, 0.02)
        off_px.append(np.hypot(*(contact.path.state(soon_us)[:2] - [x[0], y[0]])))
    assert np.median(np.abs(late_ms)) < 0.03
    assert np.median(off_px) < 0.4


def flight_above(seed: int) -> tuple[Trajectory, Camera]:
    rng = np.random.default_rng([seed, 4])
    spin_rps, speed_m_s = float(rng.uniform(0, 120)), float(rng.uniform(3.5, 22))
    return flown(flight(kind=KINDS[seed % 6], magnitude_rps=spin_rps, speed_m_s=speed_m_s, seed=seed)), ABOVE


def flight_side(seed: int) -> tuple[Trajectory, Camera]:
    rng = np.random.default_rng([seed, 5])
    speed_m_s = float(rng.uniform(3.5, 22))
    duration_s = min(0.15, 0.9 / speed_m_s)
    start = Flight(0.0, duration_s, (-0.45, float(rng.uniform(-0.1, 0.1)), 2.0),
                   (speed_m_s, *rng.uniform(-1, 1, 2).tolist()), triple(rng.uniform(-60, 60, 3)), UPRIGHT)  # fmt: skip
    return flown(Scene(duration_s, (Ball((start,)),), up=(0.0, -1.0, 0.0))), SIDE


def test_no_contact_where_there_is_none() -> None:
    """Fast and slow, strongly curved, from above and from the side: at most one in 200 flights."""
    false = 0
    for scene in (flight_above, flight_side):
        for seed in range(7800, 7900):
            path, camera = scene(seed)
            false += first_contact(path_of(path, camera, rng_of(seed)), camera) is not None
    assert false <= 1


def test_an_outlier_is_no_contact() -> None:
    """Clutter that draws one circle off by a pixel, or many by a third, bends no path."""
    scene = flight(speed_m_s=7.0, magnitude_rps=60.0, seed=7790)
    path = path_of(flown(scene), ABOVE, np.random.default_rng(2))
    one = list(path)
    circle = one[9].circle
    assert circle is not None
    one[9] = PathPoint(one[9].end_us, Circle(circle.x_px + 1.0, circle.y_px, circle.radius_px - 0.5, 1.0), one[9].noise)
    assert first_contact(one, ABOVE) is None
    rng = np.random.default_rng(3)
    many = [
        PathPoint(point.end_us, Circle(c.x_px + dx, c.y_px + dy, c.radius_px, 1.0), point.noise)
        for point in path
        if (c := point.circle)
        for dx, dy in [rng.normal(0, 0.35, 2)]
    ]
    assert first_contact(many, ABOVE) is None


def shaken(path: list[PathPoint], rng: np.random.Generator, amplitude_px: float, known_px: float) -> list[PathPoint]:
    """The path before a camera that vibrates with 10 to 50 Hz along either axis, and is known to by known_px."""
    frequencies_hz, phases = rng.uniform(10.0, 50.0, 2), rng.uniform(0.0, 2 * math.pi, 2)
    moved = []
    for point in path:
        dx, dy = amplitude_px * np.sin(2 * math.pi * frequencies_hz * point.end_us * 1e-6 + phases)
        assert point.circle is not None
        circle = replace(point.circle, x_px=point.circle.x_px + dx, y_px=point.circle.y_px + dy)
        moved.append(replace(point, circle=circle, shake_px=known_px))
    return moved


def test_a_known_vibration_is_no_contact_and_hides_none() -> None:
    """Of 0.5 px: without the knowledge most flights have false contacts."""
    known_px = TrackParameters().shake_px
    false = dict.fromkeys((0.0, known_px), 0)
    for seed in range(5000, 5020):
        speed_m_s = (4.0, 7.0, 11.0)[seed % 3]
        path = path_of(flown(flight(kind=KINDS[seed % 6], speed_m_s=speed_m_s, seed=seed)), ABOVE, rng_of(seed))
        for px in false:
            false[px] += first_contact(shaken(path, rng_of(seed), 0.5, px), ABOVE) is not None
    assert false[0.0] > 5 and false[known_px] == 0
    for scene, least in ((bounce_above, 17), (bounce_side, 20), (hit, 20)):
        found = 0
        for seed in range(5100, 5120):
            way, camera = scene(seed)
            path = shaken(path_of(way, camera, rng_of(seed)), rng_of(seed), 0.5, known_px)
            found += first_contact(path, camera) is not None
        assert found >= least


def test_a_contact_that_a_stronger_vibration_explains_is_uncertain() -> None:
    """Before a camera that shakes by 1 px, more than is known: all that flights show; none before one that is still."""
    known_px, false = TrackParameters().shake_px, 0
    for seed in range(5000, 5020):
        path = path_of(flown(flight(kind=KINDS[seed % 6], speed_m_s=7.0, seed=seed)), ABOVE, rng_of(seed))
        contact = first_contact(shaken(path, rng_of(seed), 1.0, known_px), ABOVE)
        false += contact is not None
        assert contact is None or not contact.is_certain
    assert false > 0
    for seed in range(5100, 5105):
        for scene in (bounce_above, hit):
            way, camera = scene(seed)
            contact = first_contact(path_of(way, camera, rng_of(seed)), camera)
            assert contact is not None and contact.is_certain


def test_what_is_before_and_after_an_uncertain_contact_is_of_one_shot() -> None:
    """Before a camera that shakes by 0.5 px; one that stands still leaves nothing out."""
    known_px = TrackParameters().shake_px
    for scene in (bounce_above, bounce_side, hit):
        for seed in range(5200, 5210):
            way, camera = scene(seed)
            path, at_us = path_of(way, camera, rng_of(seed)), contact_s(way) * 1e6
            clear = first_contact(path, camera)
            assert clear is not None and clear.latest_us - clear.earliest_us <= 500
            unclear = first_contact(shaken(path, rng_of(seed), 0.5, known_px), camera)
            if unclear is not None and unclear.is_certain:
                assert unclear.earliest_us <= unclear.time_us <= unclear.latest_us
                assert unclear.earliest_us - 4000 < at_us < unclear.latest_us + 4000


def rng_of(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_contact_is_announced_after_three_circles_and_at_the_end_after_one() -> None:
    path, camera = bounce_above(7702)
    circles = path_of(path, camera, np.random.default_rng(4))
    after = next(n for n, point in enumerate(circles) if point.end_us > contact_s(path) * 1e6 + CONTOUR_US)
    known = [n for n in range(len(circles)) if find_contact(circles[: n + 1], camera, 0.02, CONTOUR_US, 3)]
    assert after + 1 <= known[0] <= after + 2
    at_the_end = [n for n in range(after + 1) if find_contact(circles[: n + 1], camera, 0.02, CONTOUR_US, 1)]
    assert at_the_end and at_the_end[0] <= after


def with_stray(path: list[PathPoint], at_us: float, strays: int) -> tuple[list[PathPoint], int]:
    """The path with its first circles after a contact on the old path, as by a racket's outline, and their place."""
    first = next(n for n, point in enumerate(path) if point.end_us > at_us)
    circles = [point.circle for point in path[first - 2 : first]]
    assert circles[0] is not None and circles[1] is not None
    x_px, y_px = circles[1].x_px - circles[0].x_px, circles[1].y_px - circles[0].y_px
    old = [
        replace(circles[1], x_px=circles[1].x_px + n * x_px, y_px=circles[1].y_px + n * y_px)
        for n in range(1, strays + 1)
    ]
    ahead = [replace(point, circle=circle) for point, circle in zip(path[first:], old, strict=False)]
    return path[:first] + ahead + path[first + strays :], first


def test_a_rackets_outline_on_the_old_path_does_not_delay_a_hit() -> None:
    off_px = []
    for seed in range(97_500, 97_520):
        way, camera = hit_at_random(seed)
        at_us = contact_s(way) * 1e6
        path, stray = with_stray(path_of(way, camera, rng_of(seed)), at_us, 1)
        contact = first_contact(path, camera)
        assert contact is not None and contact.kind == "hit"
        assert contact.stray_us == path[stray].end_us and abs(contact.time_us - at_us) < 500
        x, y, radius = camera.silhouette(way.at(np.array([path[stray].end_us * 1e-6])).position_m, 0.02)
        off_px.append(np.abs(contact.path.state(path[stray].end_us)[[0, 1, 4]] - [x[0], y[0], radius[0]]).max())
    # 0.1 ms of the instant make a pixel.
    assert np.median(off_px) < 0.6
    assert np.max(off_px) < 1.5


def test_no_circle_of_the_ball_is_taken_for_a_rackets() -> None:
    """Also where the outline is seen 0.15 px farther inside after a hit, as of a ball that is faster then."""
    for seed in range(5340, 5360):
        way, camera = hit(seed)
        path, at_us = path_of(way, camera, rng_of(seed)), contact_s(way) * 1e6
        seen = [
            replace(point, circle=replace(circle, radius_px=circle.radius_px - 0.15 * (point.end_us > at_us)))
            for point in path
            if (circle := point.circle)
        ]
        contact = first_contact(seen, camera)
        assert contact is not None and contact.stray_us is None


@pytest.mark.parametrize("aside_px", [0.0, 20.0])
@pytest.mark.parametrize("strays", [1, 2])
@pytest.mark.parametrize("seed", range(5320, 5325))
def test_a_ball_found_where_it_continues_anothers_path_begins_with_the_hit(
    seed: int, strays: int, aside_px: float
) -> None:
    """The other's shot ends there, whatever was measured on its old path since; not where it passes by at a radius."""
    way, camera = hit(seed)
    at_us, circles = contact_s(way) * 1e6, path_of(way, camera, rng_of(seed))
    path, first = with_stray(circles, at_us, strays)
    found = circles[first + strays - 1]
    assert found.circle is not None
    (x, y, _), (later_x, later_y, _) = (
        np.ravel(camera.silhouette(way.at(np.array([us * 1e-6])).position_m, 0.02))
        for us in (found.end_us, found.end_us + 1)
    )
    velocity_px_s = 1e6 * np.array([later_x - x, later_y - y]) + rng_of(seed).normal(0.0, 50.0, 2)
    ring = np.array([found.circle.x_px, found.circle.y_px + aside_px, *velocity_px_s, found.circle.radius_px])
    group = TrackParameters(outline_px=0.0, lag_px=0.0)
    state = track.start(group, Context(camera, 0.02, {"filter.contour_mode": "plain"}))
    packet = Packet(0, found.end_us - TICK_US, found.end_us, EventBatch.empty())
    state.past.add(packet)
    known = state.measuring.filter_at(ring, np.eye(5))
    old = TrackedBall(0, 0, "start", known, found.end_us, ring, path[: first + strays])
    state.balls, state.shots = [old], 1
    spread = np.diag([0.01, 0.01, 100.0**2, 100.0**2, 0.01])
    sighting = Sighting(ring, spread, 0.1, 80, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0)
    earlier: Earlier = {}
    ended: list[ShotEnd] = []
    track_initiation._begin(group, state, packet, sighting, earlier, ended)
    if aside_px:
        assert not ended and [ball.began_by for ball in state.balls] == ["start", "start"]
        return
    ((end,), (ball,)) = ended, state.balls
    assert (end.shot, end.ended_by, ball.shot, ball.began_by, ball.start_us) == (0, "hit", 1, "hit", end.end_us)
    assert abs(end.end_us - at_us) < 500
    states = (*earlier[1], ball.track(found.end_us, group.latency_us, 0.0, ()))
    ends_us = np.array([one.t_us + one.latency_us for one in states])
    assert ends_us.tolist() == [point.end_us for point in path[first : first + strays]]
    true = np.stack(camera.silhouette(way.at(ends_us * 1e-6).position_m, 0.02), axis=1)
    assert np.abs(np.array([one.mean[[0, 1, 4]] for one in states]) - true).max() < 1.5
    assert [one.measured for one in earlier[1]] == [None] * (strays - 1)


def test_a_short_path_tells_nothing() -> None:
    path = path_of(bounce_above(7703)[0], ABOVE, np.random.default_rng(6))[:3]
    assert find_contact(path, ABOVE, 0.02, CONTOUR_US, 3) is None


@pytest.mark.parametrize(
    ("before", "after", "unsure", "kind"),
    [
        ((5.0, 0.0, -2.0), (4.2, 0.0, 1.7), (0.0, 0.0, 0.1), "bounce"),
        ((5.0, 0.0, -2.0), (-5.0, 0.0, 1.7), (0.0, 0.0, 0.1), "hit"),  # rubbed by more than any table
        ((5.0, 0.0, 2.0), (4.2, 0.0, 4.0), (0.0, 0.0, 0.1), "hit"),  # it rose
        ((5.0, 0.0, -2.0), (4.2, 0.0, -4.0), (0.0, 0.0, 0.1), "hit"),  # pushed down
        ((5.0, 0.0, -2.0), (4.2, 1.5, 1.0), (0.0, 0.0, 0.0), "bounce"),
        ((5.0, 0.0, -2.0), (4.2, 1.8, 1.0), (0.0, 0.0, 0.0), "hit"),
        ((5.0, 0.0, -2.0), (4.2, 1.8, 1.0), (0.0, 0.0, 1.0), "bounce"),  # seen from above: the push may be larger
        ((5.0, 0.0, -2.0), (4.2, 4.0, 1.0), (0.0, 3.0, 0.0), "bounce"),  # from the side: rubbed by less
        ((5.0, 0.0, -2.0), (-9.0, 0.0, 1.0), (0.0, 0.0, 90.0), "hit"),  # by no push that a table gives
    ],
)
def test_a_table_pushes_up_and_rubs(
    before: tuple[float, ...], after: tuple[float, ...], unsure: tuple[float, ...], kind: str
) -> None:
    up = np.array([0.0, 0.0, 1.0])
    assert track_contact._kind(np.array(before), np.array(after), np.array(unsure), up) == kind
