"""`spinscope settings`: the list of settings for people and programs."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from spinscope.app.cli import cli
from spinscope.pipeline.registry import Parameters


def listed(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["settings", *arguments])


def test_every_setting_is_listed_once_with_its_declaration() -> None:
    rows = json.loads(listed("--json", "-").output)
    declared = {
        f"{group}.{name}": one
        for group, parameters in Parameters.group_types().items()
        for name, one in parameters.tunables().items()
    }
    assert [row["name"] for row in rows] == list(declared)
    for row in rows:
        one = declared[row["name"]]
        default = list(one.default) if isinstance(one.default, tuple) else one.default
        assert (row["default"], row["low"], row["high"], row["unit"]) == (default, one.low, one.high, one.unit)
        assert row["help"] == one.help and row["allowed"] == one.allowed


@pytest.mark.parametrize("stage", ["spin", "triplet"])
def test_a_stage_has_the_settings_of_its_group(stage: str) -> None:
    rows = json.loads(listed("--stage", stage, "--json", "-").output)
    assert {row["name"].partition(".")[0] for row in rows} == {"spin"}


def test_the_table_has_name_default_range_and_meaning_in_one_line() -> None:
    lines = listed("--stage", "track").output.splitlines()
    tick = next(line for line in lines if line.startswith("track.tick_us"))
    for text in ("5000 us", "200 to 100000 us", "time between two steps"):
        assert text in tick
    assert next(line for line in lines if line.startswith("track.radius_min_px")).split()[1] == "auto"


def test_the_defaults_of_the_table_are_taken_by_set() -> None:
    rows = json.loads(listed("--json", "-").output)
    table = dict(line.split(maxsplit=1) for line in listed().output.splitlines()[1:] if line.strip())
    for row in rows:
        if row["default"] is not None:
            value = table[row["name"]].split()[0]
            assert Parameters().with_assignments([f"{row['name']}={value}"]) == Parameters()


def test_a_stage_that_is_none_gets_those_there_are() -> None:
    done = listed("--stage", "tripel")
    assert done.exit_code == 2 and "triplet" in done.output


def test_the_help_of_analyze_says_what_the_marks_of_its_table_mean() -> None:
    words = " ".join(CliRunner().invoke(cli, ["analyze", "--help"]).output.split())
    for text in (
        "* marks the one estimate that the program itself trusts",
        "1 sigma, the standard deviation",
        "rps are",
    ):
        assert text in words
