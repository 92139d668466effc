"""Rivals: right within what they can do on balls whose spin is known, run only when named, and never trusted."""

from __future__ import annotations

import copy
import dataclasses
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app import viewer
from spinscope.app.cli import cli
from spinscope.app.viewer import entities
from spinscope.pipeline import ParameterError, estimate
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.registry import STAGES, Parameters, default_stages, rival_methods, trusted_method
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.spin.rivals.eeppr import template_response
from spinscope.pipeline.spin.rivals.logo_orientation import turning
from spinscope.pipeline.stage import Context
from tests.app.viewer.reading import read_back
from tests.pipeline.stages.test_contract import assert_same
from tests.spinning_ball import CONTEXT, after_track, errors, known_track, packets, spinning_ball

RIVALS = [method.name for method in rival_methods()]
STILL, LOGO_AT = (0.0, 0.0, 2.0), {"top": (0.0, 0.0, -1.0), "side": (0.7, 0.0, -0.7)}
SPINS = {"top": (50.0, 0.0, 0.0), "side": (0.0, 0.0, 50.0)}


@cache
def inputs(kind: str) -> list[dict[str, Any]]:
    """Results of the stages before the spin, tick by tick, of a ball in place."""
    events = spinning_ball(np.array(SPINS[kind]), towards=LOGO_AT[kind], centre_m=STILL)
    ticks = [(packet, known_track(packet.end_us, centre_m=STILL)) for packet in packets(events)]
    return [
        {"packet": packet, "ball": track.ball, "logo": seen, "rate": rhythm, "flow": flow}
        for (packet, track), (seen, rhythm, flow, _) in zip(ticks, after_track(ticks), strict=True)
    ]


def last(name: str, kind: str) -> SpinEstimate:
    method = STAGES[name]
    values = {**CONTEXT.values, **{read: Parameters().value(read) for read in method.reads}}
    state = method.start(SpinParameters(), Context(CONTEXT.camera, CONTEXT.ball_radius_m, values))
    for given in inputs(kind):
        result = method.step(SpinParameters(), state, *[given[name] for name in method.inputs])
    return result.estimate


@pytest.mark.parametrize(
    ("name", "kind", "rps", "deg"),
    [
        ("s_cmax", "top", 1.0, 3.0),
        ("s_cmax", "side", 1.0, 3.0),
        ("s_cmax_online", "top", 3.0, 6.0),
        ("lucas_kanade", "top", 25.0, 40.0),
        ("plane_flow", "top", 25.0, 20.0),
        ("time_surface", "top", 25.0, 20.0),
        ("eeppr", "top", 2.0, 20.0),
        ("logo_orientation", "top", 25.0, 40.0),
    ],
)
def test_it_finds_the_spin_as_well_as_it_can(name: str, kind: str, rps: float, deg: float) -> None:
    found = last(name, kind)
    off_rps, off_deg = errors(found, np.array(SPINS[kind]))
    assert abs(off_rps) < rps and off_deg < deg
    assert found.magnitude_std_rps is None, "none of them states an uncertainty"


@pytest.mark.parametrize("name", RIVALS)
def test_without_a_logo_it_refuses(name: str) -> None:
    method, (given, *_) = STAGES[name], inputs("top")
    values = {**CONTEXT.values, **{read: Parameters().value(read) for read in method.reads}}
    state = method.start(SpinParameters(), Context(CONTEXT.camera, CONTEXT.ball_radius_m, values))
    nothing = given["packet"].events[:0]
    packet = dataclasses.replace(given["packet"], events=nothing)
    empty = {**given, "packet": packet}
    for stage in ("logo", "flow"):
        group = Parameters().group(stage)
        empty[stage] = STAGES[stage].absent(group, "no ball")  # type: ignore[misc]
    empty["logo"] = dataclasses.replace(empty["logo"], radius_px=16.5)
    found = method.step(SpinParameters(), state, *[empty[name] for name in method.inputs]).estimate
    assert found.vector_rps is None and found.reason


@pytest.mark.parametrize("name", RIVALS)
def test_stop_and_resume_gives_the_same_and_inputs_stay(name: str) -> None:
    method = STAGES[name]
    values = {**CONTEXT.values, **{read: Parameters().value(read) for read in method.reads}}
    state = method.start(SpinParameters(), Context(CONTEXT.camera, CONTEXT.ball_radius_m, values))
    ticks, other = inputs("top"), None
    before = copy.deepcopy(ticks)
    for number, given in enumerate(ticks):
        if number == len(ticks) // 2:
            other = copy.deepcopy(state)
        taken = [given[one] for one in method.inputs]
        result = method.step(SpinParameters(), state, *taken)
        if other is not None:
            assert_same(method.step(SpinParameters(), other, *taken), result)
    for given, kept in zip(ticks, before, strict=True):
        assert_same(given, kept)


def test_only_named_rivals_run_and_none_is_trusted(samples: Path) -> None:
    assert not set(RIVALS) & set(default_stages())
    assert set(default_stages(["eeppr"])) - set(default_stages()) == {"eeppr"}
    with pytest.raises(ParameterError, match="did you mean s_cmax"):
        default_stages(["scmax"])
    with pytest.raises(ParameterError, match="no rival 'contrast'"):
        Chain(Session.open(samples / "flight_back.h5").source, rivals=["contrast"])
    sure = SpinEstimate("eeppr", np.array([9.0, 0.0, 0.0]), np.eye(3) * 1e-6, None)
    assert trusted_method({"eeppr": sure}) is None


def test_a_named_rival_is_a_line_in_reports_and_a_curve_in_the_viewer(samples: Path, tmp_path: Path) -> None:
    def shot(*options: str) -> dict[str, Any]:
        sample = samples / "flight_fast_top.h5"
        done = CliRunner().invoke(cli, ["analyze", str(sample), "--json", "-", *options])
        assert done.exit_code == 0, done.output
        (found,) = json.loads(done.stdout)["shots"]
        return dict(found)

    both, own = shot("--method", "triplet", "--rival", "logo_orientation"), shot("--method", "triplet")
    rival = both["spin"].pop("logo_orientation")
    assert rival["magnitude_rps"] is not None and rival["magnitude_std_rps"] is None
    assert both == own, "nothing else changes"
    assert shot("--method", "logo_orientation")["spin"] == {"logo_orientation": rival}
    session = Session.open(samples / "flight_fast_top.h5", Choices(rivals=("logo_orientation",)))
    assert session.chain.stages == default_stages(["logo_orientation"]) == session.clip(0, 60_000).chain.stages
    ticks = session.ticks(("surface", "flow", "triplet", "logo_orientation"))
    viewer.save(Result.of(session, ticks), tmp_path / "run.rrd")
    logged = read_back(tmp_path / "run.rrd")
    assert logged[f"{entities.SPIN_MAGNITUDE}/logo_orientation"].static["names"] == ["Logo orientation"]


def test_the_api_runs_rivals_besides(samples: Path) -> None:
    (shot,) = estimate(samples / "flight_fast_top.h5", method="triplet", rivals=["logo_orientation"]).shots
    assert list(shot.estimates) == ["triplet", "logo_orientation"]
    assert shot.best is None


def test_the_template_comes_back_with_the_period() -> None:
    """Counts that repeat after seven bins answer strongest at the multiples of seven."""
    random = np.random.default_rng(3)
    counts = np.tile(random.poisson(1.0, (7, 5)), (6, 1)).astype(float)
    response = template_response(counts, 7)
    assert set(np.argsort(response)[-4:]) <= {0, 7, 14, 21, 28, 35}


def test_a_circle_of_directions_gives_its_axis_and_speed() -> None:
    """About z at 20 rps, 30 degrees from the axis, seen in two visits a turn and a half apart."""
    times_s = np.concatenate([np.arange(5), 37 + np.arange(5)]) * 2e-3
    angle = 2 * np.pi * 20.0 * times_s
    places = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), np.full(10, -np.sqrt(0.75))], axis=1)
    spin_rps = turning(times_s, places, 6e-3)
    assert spin_rps is not None
    np.testing.assert_allclose(spin_rps, [0.0, 0.0, 20.0], atol=1e-6)
    np.testing.assert_allclose(turning(times_s, places * [1, -1, 1], 6e-3), [0.0, 0.0, -20.0], atol=1e-6)
