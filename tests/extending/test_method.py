"""A spin method of one's own: registered in one place, found in reports, tables, plots, and as the trusted answer."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from spinscope.app import viewer
from spinscope.app.cli import cli
from spinscope.app.viewer import entities
from spinscope.pipeline import estimate
from spinscope.pipeline.registry import STAGES, methods
from spinscope.pipeline.results import MethodResult, Packet, SpinEstimate
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.stage import Context, SpinMethod
from spinscope.pipeline.stages.logo import LogoResult
from tests.app.viewer.reading import read_back

SPIN_RPS = np.array([0.0, -25.0, 0.0])


def step(parameters: SpinParameters, state: None, packet: Packet, logo: LogoResult) -> MethodResult:
    return MethodResult(SpinEstimate("toy", SPIN_RPS, np.eye(3), None))


def start(parameters: SpinParameters, context: Context) -> None:
    return None


def absent(parameters: SpinParameters, reason: str) -> MethodResult:
    return MethodResult(SpinEstimate.refused("toy", reason))


def always_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    return estimates["toy"].vector_rps is not None


TOY = SpinMethod(
    name="toy",
    label="Toy method",
    help="The same spin for every ball.",
    inputs=("packet", "logo"),
    parameters=SpinParameters,
    start=start,
    step=step,
    absent=absent,
    colour=(10, 20, 30),
    is_trusted=always_trusted,
)


@pytest.fixture
def toy() -> Iterator[SpinMethod]:
    with STAGES.registered(TOY):
        yield TOY


def spinscope(*arguments: Any) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


@pytest.mark.usefixtures("toy")
def test_its_estimate_is_reported_and_trusted_where_its_rule_says_so(samples: Path) -> None:
    sample = samples / "flight_fast_top.h5"
    (shot,) = json.loads(spinscope("analyze", sample, "--json", "-").stdout)["shots"]
    assert list(shot["spin"]) == ["triplet", "normal_flow", "contrast", "trajectory", "combined", "toy"]
    assert shot["spin"]["toy"]["vector_rps"] == SPIN_RPS.tolist()
    assert shot["best"] == "toy"
    done = spinscope("analyze", sample, "--method", "toy")
    assert done.exit_code == 0, done.output
    assert "* toy" in done.stdout and "triplet" not in done.stdout
    assert "toy" in spinscope("analyze", "--help").stdout


def test_its_rule_may_leave_the_answer_to_another(samples: Path) -> None:
    shy = dataclasses.replace(TOY, is_trusted=lambda estimates: False)
    with STAGES.registered(shy):
        (shot,) = estimate(samples / "flight_fast_top.h5").shots
    assert shot.best == "contrast"
    assert shot.estimates["toy"].magnitude_rps == 25.0


@pytest.mark.usefixtures("toy")
def test_it_has_its_curve_its_arrow_its_mark_on_the_score_and_its_row(samples: Path, tmp_path: Path) -> None:
    result = estimate(samples / "flight_fast_top.h5")
    viewer.save(result, tmp_path / "run.rrd")
    logged = read_back(tmp_path / "run.rrd")
    end_us = result.shots[0].end_us
    for plot, label in ((entities.SPIN_MAGNITUDE, "Toy method"), (entities.AXIS_ERROR, "Toy method [°]")):
        curve = logged[f"{plot}/toy"]
        assert curve.static["names"] == [label]
        assert curve.static["colors"] == [0x0A141EFF]
    assert logged[f"{entities.SPIN_MAGNITUDE}/toy"].at("values", end_us) == [25.0]
    assert logged[f"{entities.SPIN_ARROWS}/toy"].at("colors", end_us) == [0x0A141EFF]
    (places,) = logged[f"{entities.SCORE_MAGNITUDE}/toy"].at("abscissa", end_us)
    assert places["buffer"] == [25.0]
    (text,) = logged[entities.SUMMARY].at("text", end_us)
    assert text.startswith("## 25.0 rps")
    assert "| **Toy method ✔** | 25.0 ± 1.0 |" in text


def test_it_is_gone_afterwards(samples: Path) -> None:
    assert "toy" not in [method.name for method in methods()]
    done = spinscope("analyze", samples / "flight_fast_top.h5", "--method", "toy")
    assert done.exit_code == 2
    assert (
        "'triplet', 'normal_flow', 'contrast', 'trajectory', 'combined', " in done.output
        and "'toy'," not in done.output
    )
