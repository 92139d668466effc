"""Flow: slices of a tenth of a rotation, each with its own Triplet Matching, and normal flow of local planes."""

from __future__ import annotations

from functools import cache
from operator import attrgetter

import numpy as np
import pytest

from spinscope.pipeline.kernels.triplet import earlier_neighbours, triplet_flow
from spinscope.pipeline.stages.flow import FlowParameters, FlowResult
from tests.reference.sphere import image_velocity
from tests.spinning_ball import CAMERA, after_track, known_track, no_track, packets, spinning_ball

SPIN_RPS = np.array([40.0, 5.0, -20.0])
TRIPLETS = ("events.t_us", "events.x_px", "events.points_m", "events.normals", "vx_px_s", "vy_px_s", "slice_index")
FLIGHT = {"centre_m": (0.1, -0.2, 1.8), "velocity_m_s": (0.5, 6.0, -0.4)}


@cache
def turning() -> list:
    """A ball that turns in place, in ticks with its track."""
    return [(packet, known_track(packet.end_us)) for packet in packets(spinning_ball(SPIN_RPS))]


@cache
def flying() -> list:
    events = spinning_ball(SPIN_RPS, **FLIGHT)
    return [(packet, known_track(packet.end_us, **FLIGHT)) for packet in packets(events)]


def flows(ticks: list, **parameters: object) -> list[FlowResult]:
    return [result[2] for result in after_track(ticks, flow_parameters=FlowParameters(**parameters))]


def column(results: list[FlowResult], name: str) -> np.ndarray:
    """A column of all results, as `vx_px_s` or `normal_events.t_us`."""
    return np.concatenate([attrgetter(name)(result) for result in results])


@pytest.mark.parametrize("t_acc_us", [1700, 8000])
def test_slices_follow_each_other_from_the_shots_start_and_belong_to_the_tick_they_end_in(t_acc_us: int) -> None:
    """Shorter and longer than a tick of 5 ms; each slice's flow is Triplet Matching on its events alone."""
    ticks = turning()
    ticks = [(packet, no_track(packet.end_us)) for packet, _ in ticks[:1]] + ticks[1:]
    results = after_track(ticks, flow_parameters=FlowParameters(t_acc_from="fixed", t_acc_us=t_acc_us))
    logo = [result[0] for result in results]
    t = np.concatenate([seen.events.t_us for seen in logo])
    x, y = (np.concatenate([getattr(seen, name) for seen in logo]) for name in ("x_px", "y_px"))
    on = np.concatenate([seen.events.on for seen in logo])
    for (packet, _), (_, _, flow, _) in zip(ticks, results, strict=True):
        ended = [number for number in range(100) if packet.start_us < 5000 + (number + 1) * t_acc_us <= packet.end_us]
        assert set(flow.slice_index.tolist()) <= set(ended)
        for number in ended:
            start_us = 5000 + number * t_acc_us
            own = (t >= start_us) & (t < start_us + t_acc_us)
            bound = flow.speed_bound_px_s
            near = earlier_neighbours((t[own], x[own], y[own], on[own]), 0.7, 3.0, t_acc_us / 2, bound, 12)
            vx, vy, triplets = triplet_flow(t[own], x[own], y[own], near, 0.5, 0.2)
            here = flow.slice_index == number
            np.testing.assert_array_equal(flow.vx_px_s[here], vx[triplets > 0])
            np.testing.assert_array_equal(flow.vy_px_s[here], vy[triplets > 0])
            np.testing.assert_array_equal(flow.events.t_us[here], t[own][triplets > 0])
    assert column([result[2] for result in results], "events.t_us").size > 100


def test_a_slice_is_a_tenth_of_a_rotation() -> None:
    assert {r.t_acc_us for r in flows(turning(), t_acc_from="expected", expected_spin_rps=80.0)} == {1250}
    assert {r.t_acc_us for r in flows(turning(), t_acc_from="fixed", t_acc_us=700)} == {700}
    assert flows(turning())[0].speed_bound_px_s == pytest.approx(2 * np.pi * 150.0 * turning()[0][1].mean[4])
    results = after_track(turning(), flow_parameters=FlowParameters(expected_spin_rps=80.0))
    for _, rate, flow, _ in results:
        assert flow.t_acc_us == (1250 if rate.spin_rps is None else round(1e5 / rate.spin_rps))
    assert any(rate.spin_rps is not None for _, rate, _, _ in results)


def test_without_a_ball_there_is_no_flow() -> None:
    results = flows([(packet, no_track(packet.end_us)) for packet, _ in turning()])
    assert all(result.t_acc_us is None for result in results)
    assert all(column(results, name).size == 0 for name in (*TRIPLETS, "normal_events.t_us", "normal_in_image"))


@pytest.mark.parametrize("ticks", [turning, flying])
def test_normal_flow_is_the_surfaces_velocity_across_the_edges(ticks: object) -> None:
    results = flows(ticks())
    points, normals = column(results, "normal_events.points_m"), column(results, "normal_events.normals")
    true = image_velocity(points, normals, 2 * np.pi * SPIN_RPS, CAMERA.focal_px, 0.02)
    direction, speed = column(results, "normal_direction"), column(results, "normal_speed_px_s")
    ball = ~column(results, "normal_in_image")
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0)
    assert np.all((speed > 0) & (speed <= results[0].speed_bound_px_s * 1.01))
    across = np.sum(true * direction, axis=1)
    assert np.median(np.abs(across[ball] / speed[ball] - 1)) < 0.15
    assert ball.sum() > 100
    if ticks is flying:
        assert (~ball).sum() > 100
        assert np.median(np.abs(across[~ball] - speed[~ball])) < 0.25 * np.median(np.linalg.norm(true, axis=1))
    else:
        assert ball.all()


def test_triplet_flow_points_where_the_surface_moves() -> None:
    results = flows(turning())
    true = image_velocity(
        column(results, "events.points_m"), column(results, "events.normals"), 2 * np.pi * SPIN_RPS, 1646.09, 0.02
    )
    flow = np.stack([column(results, "vx_px_s"), column(results, "vy_px_s")], axis=1)
    cosine = np.sum(true * flow, axis=1) / np.linalg.norm(true, axis=1) / np.linalg.norm(flow, axis=1)
    assert np.median(cosine) > 0.9
    assert np.median(np.linalg.norm(flow, axis=1) / np.linalg.norm(true, axis=1)) == pytest.approx(1.0, abs=0.15)


def test_normal_flow_comes_when_its_neighbours_are_known_and_only_once() -> None:
    ticks = turning()
    for (packet, _), result in zip(ticks, flows(ticks), strict=True):
        assert result.t_acc_us is not None
        assert np.all(result.normal_events.t_us < packet.end_us - 0.6 * result.t_acc_us)
    t = column(flows(ticks), "normal_events.t_us")
    assert np.all(np.diff(t) >= 0)
    x, y = (column(flows(ticks), name) for name in ("normal_events.x_px", "normal_events.y_px"))
    assert len({*zip(t, x, y, strict=True)}) == t.size
