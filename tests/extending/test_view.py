"""A view of one's own: registered in one place, found on the command line, in files and among the page's tabs."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rerun.blueprint as rrb
from click.testing import CliRunner, Result

from spinscope.app.cli import cli
from spinscope.app.viewer import entities, panes
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.views import VIEWS, View, views
from tests.app.viewer.reading import read_back


def toy_panes(run: ViewedRun) -> rrb.Container:
    return rrb.Horizontal(panes.events(run), panes.text(entities.SUMMARY, "Toy summary"))


TOY = View(name="toy", label="Toy tab", help="Events beside the summary.", panes=toy_panes)


@pytest.fixture
def toy() -> Iterator[View]:
    with VIEWS.registered(TOY):
        yield TOY


def spinscope(*arguments: Any) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


@pytest.mark.usefixtures("toy")
def test_it_is_a_tab_of_the_page_and_of_a_file_and_opens_in_front(samples: Path, tmp_path: Path) -> None:
    assert views(compare=True)[-1] is TOY
    path = tmp_path / "run.rrd"
    done = spinscope("view", samples / "spinner_ball5_back_no_logo.h5", "--layout", "toy", "--save", path)
    assert done.exit_code == 0, done.output
    logged = read_back(path, blueprint=True)
    tabs = {key: rows.static for key, rows in logged.items() if key.startswith("/container/")}
    (own,) = [key for key, static in tabs.items() if static.get("display_name") == ["Toy tab"]]
    root = logged["/viewport"].static["root_container"][0]
    assert tabs[f"/container/{uuid.UUID(bytes=bytes(root))}"]["active_tab"][0].strip("/") == own.strip("/")
    assert ["Toy summary"] in [rows.static.get("display_name") for rows in logged.values()]


@pytest.mark.usefixtures("toy")
def test_help_names_it() -> None:
    said = " ".join(spinscope("view", "--help").stdout.split())
    assert "all|tracker|logo|spin|coach|toy" in said
    assert "Events beside the summary." in said


def test_it_is_gone_afterwards(samples: Path) -> None:
    done = spinscope("view", samples / "flight_fast_top.h5", "--layout", "toy")
    assert done.exit_code == 2
    assert "'all', 'tracker', 'logo', 'spin', 'coach'" in done.output
