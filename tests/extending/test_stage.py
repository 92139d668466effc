"""A stage of one's own: registered in one place, found in parameters, sliders, results, timings and drawings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app import viewer
from spinscope.app.cli import cli
from spinscope.app.viewer.curves import Curve, Plot
from spinscope.app.viewer.drawers import DRAWERS, Drawer
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.web.controls import sections
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.parameters import ParameterGroup, tunable
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.results import Packet
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.stage import Context, Stage
from spinscope.pipeline.stages.logo import LogoResult
from tests.app.viewer.reading import read_back


@dataclass(frozen=True, kw_only=True)
class ToyParameters(ParameterGroup):
    """Parameters of the toy."""

    gain: float = tunable(1.0, 0.0, 10.0, 0.5, "", "factor of the count")


@dataclass(frozen=True)
class ToyResult:
    """Logo events of the shot so far, times gain."""

    count: float


def step(parameters: ToyParameters, state: list[int], packet: Packet, logo: LogoResult) -> ToyResult:
    state.append(len(logo.events))
    return ToyResult(parameters.gain * sum(state))


def start(parameters: ToyParameters, context: Context) -> list[int]:
    return []


TOY = Stage(
    name="toy",
    label="Toy",
    help="Count of the logo events.",
    inputs=("packet", "logo"),
    parameters=ToyParameters,
    start=start,
    step=step,
    absent=lambda parameters, reason: ToyResult(np.nan),
)


def toy_curves(run: ViewedRun) -> list[Curve]:
    return [Curve("count", "events", (255, 255, 255), np.array([result.count for result in run.results("toy")]))]


TOY_PLOT = Plot("/plots/toy", "Toy", toy_curves)


@pytest.fixture
def toy() -> Iterator[Stage]:
    with STAGES.registered(TOY) as stage:
        yield stage


@pytest.mark.usefixtures("toy")
def test_its_parameters_are_found_wherever_there_are_parameters(samples: Path) -> None:
    parameters = Parameters().with_assignments(["toy.gain=2"])
    assert parameters.value("toy.gain") == 2
    with pytest.raises(ParameterError, match=r"toy\.gain"):
        parameters.with_assignments(["toy.gain=11"])
    assert "toy.gain" in repr(sections())
    done = CliRunner().invoke(
        cli, ["analyze", str(samples / "flight_fast_top.h5"), "--json", "-", "--set", "toy.gain=2"]
    )
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["parameters"]["toy"] == {"gain": 2.0}


@pytest.mark.usefixtures("toy")
def test_its_results_are_kept_timed_and_drawn(samples: Path, tmp_path: Path) -> None:
    session = Session.open(samples / "flight_fast_top.h5", Choices(assignments=["toy.gain=2"]))
    result = session.estimate_keeping_ticks()
    counts = [tick.toy.count for tick in result.ticks]
    assert counts[-1] == 2 * result.shots[0].logo_events
    assert session.chain.seconds["toy"] > 0
    before = dict(session.chain.seconds)
    other = session.parameters.with_assignments(["toy.gain=3"])
    again = list(session.chain.run(other, ("toy",)))
    assert again[-1].toy.count == 1.5 * counts[-1]
    assert {name for name, seconds in session.chain.seconds.items() if seconds != before[name]} == {"toy"}
    with DRAWERS.registered(Drawer(name="toy", stage="toy", plots=(TOY_PLOT,))):
        viewer.save(result, tmp_path / "run.rrd")
        drawn = read_back(tmp_path / "run.rrd")[f"{TOY_PLOT.entity}/count"]
        assert [drawn.at("scalars", tick.packet.end_us) for tick in result.ticks] == [[count] for count in counts]


def test_it_is_gone_afterwards(samples: Path, tmp_path: Path) -> None:
    """A drawer whose stage is not run draws nothing."""
    assert "toy" not in Parameters().as_dict()
    result = Session.open(samples / "spinner_ball5_back_no_logo.h5", Choices()).estimate_keeping_ticks()
    with DRAWERS.registered(Drawer(name="toy", stage="toy", plots=(TOY_PLOT,))):
        viewer.save(result, tmp_path / "run.rrd")
    assert not [path for path in read_back(tmp_path / "run.rrd") if path.startswith(TOY_PLOT.entity)]
