"""Labels of the ball on the page: told, drawn, changed, undone, and refused where the file is another one by now."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.web.label_routes import EXPOSED, IN_THE_MIDDLE, exposure_picture
from spinscope.pipeline.calibration.ball_labels import LATENCY_US, BallLabels, labels_beside
from spinscope.pipeline.calibration.label_file import HAND_STD_PX
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording

from .browser_tab import PATIENCE_MS, bare_tab, needs_browser, pauses
from .conftest import Client, Served


@pytest.fixture
def path(tuner: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Labels of the tuner's recording on the true ball, in another place than beside it."""
    truth = open_recording(tuner.state.path).truth
    assert truth is not None
    made = tmp_path / "made.csv"
    at = np.arange(truth.t_us.size // 3, 2 * truth.t_us.size // 3, truth.t_us.size // 15)
    rows = [(truth.t_us[i], truth.x_px[i], truth.y_px[i], truth.radius_px[i], 0.1, 1) for i in at]
    lines = ["t_us,x_px,y_px,radius_px,std_px,ball", *(",".join(f"{one:.3f}" for one in row) for row in rows)]
    made.write_text("\n".join(lines))
    monkeypatch.setattr(tuner.state, "labels", made)
    return made


def test_labels_are_told_and_changed_and_a_change_of_another_version_is_refused(client: Client, path: Path) -> None:
    told = client.http.get(client.path("labels")).json()
    assert told["path"] == str(path) and {one["state"] for one in told["labels"]} == {"detected"}
    moved = {**told["labels"][1], "x_px": 12.5, "state": "moved"}
    change = {"version": told["version"], "first": 1, "removed": 1, "labels": [moved]}
    version = client.post("labels", **change).json()["version"]
    assert BallLabels.read(path).x_px[1] == 12.5
    refused = client.post("labels", **change)
    assert refused.status_code == 400 and "changed elsewhere" in refused.json()["error"]
    wrong = {**change, "version": version, "labels": [{**moved, "radius_px": -1.0}]}
    assert client.post("labels", **wrong).status_code == 422
    picture = client.http.get(client.path("label.png"), params={"t_us": moved["t_us"]}).content
    assert cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_GRAYSCALE).max() == IN_THE_MIDDLE


def test_the_middle_of_an_exposure_is_bright() -> None:
    t_us = np.array([1000, 5400, 5600, 9000])
    events = EventBatch(t_us, np.arange(4, dtype=np.uint16), np.zeros(4, np.uint16), np.ones(4, bool))
    content = np.frombuffer(exposure_picture(events, 5000, (2, 5)), np.uint8)
    grey = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE)
    assert grey[0].tolist() == [EXPOSED, IN_THE_MIDDLE, EXPOSED, EXPOSED, 0] and not grey[1].any()
    assert LATENCY_US < 100  # far less than an exposure


def test_the_command_goes_on_with_labels_and_overwrites_none_that_were_looked_at(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
    monkeypatch.setattr("spinscope.app.web.serve", lambda *given, **named: asked.append((given, named)))
    recording = tmp_path / "a.raw"
    recording.touch()
    beside = labels_beside(recording)
    text = "t_us,x_px,y_px,radius_px,std_px,ball,state\n1,2,3,4,0.1,1,accepted\n"
    beside.write_text(text)
    done = CliRunner().invoke(cli, ["label", str(recording), "--view", "--port", "0", "--no-browser"])
    assert done.exit_code == 0, done.output
    assert [given["labels"] for _, given in asked] == [beside]
    refused = CliRunner().invoke(cli, ["label", str(recording)])
    assert refused.exit_code != 0 and "--view" in str(refused.exception) and beside.read_text() == text


@needs_browser[0]
@needs_browser[1]
def test_labels_are_gone_through_by_key_and_mouse(browser: Any, tuner: Served, path: Path) -> None:
    before = BallLabels.read(path)
    tab = bare_tab(browser, tuner.address)
    page = tab.page
    dialog = page.locator("dialog.labels")
    dialog.wait_for()
    rows = dialog.locator("nav button")
    assert rows.count() == before.ball.size

    def saved(holds: Callable[[BallLabels], bool]) -> None:
        """Wait until what is in the file holds."""
        end_s, waiting = time.monotonic() + PATIENCE_MS / 1000, pauses(page)
        while not holds(found := BallLabels.read(path)):
            assert time.monotonic() < end_s, found
            next(waiting)

    page.keyboard.press("Enter")
    page.keyboard.press("Shift+ArrowRight")
    box = dialog.locator("svg").bounding_box()
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    was = dialog.locator("[role=status]").inner_text()
    page.mouse.wheel(0, -100)
    tab.until(f"document.querySelector('dialog.labels [role=status]').textContent !== {was!r}")
    page.keyboard.press("n")
    size = before.ball.size
    saved(lambda labels: labels.state.tolist() == ["accepted", "moved", *["detected"] * (size - 2)])
    saved(lambda labels: abs(labels.x_px[1] - before.x_px[1] - 5.0) < 0.01)
    saved(lambda labels: abs(labels.radius_px[1] - before.radius_px[1] - 0.5) < 0.01)
    page.mouse.down()
    page.mouse.move(box["x"] + 90, box["y"] + 50)
    page.mouse.up()
    page.keyboard.press("p")
    page.keyboard.press("x")
    saved(lambda labels: labels.ball.size == size - 1 and labels.x_px[1] > before.x_px[2] + 1)
    assert "1 accepted, 1 moved by hand" in page.inner_text("#side [data-title=Labels]")
    for _ in range(6):  # key and wheel are one change or two, as the machine is fast or slow
        page.keyboard.press("Control+z")
    saved(lambda labels: labels.state.tolist() == ["detected"] * size)
    assert BallLabels.read(path).x_px == pytest.approx(before.x_px, abs=1e-3)
    rows.nth(0).click()
    page.keyboard.press("i")  # a missed one, half-way to the next
    saved(lambda labels: labels.state.tolist() == ["detected", "moved", *["detected"] * (size - 1)])
    added = BallLabels.read(path)
    assert added.t_us[0] < added.t_us[1] <= added.t_us[0] + 2500 and added.std_px[1] == HAND_STD_PX
    share = (added.t_us[1] - added.t_us[0]) / (added.t_us[2] - added.t_us[0])
    assert added.x_px[1] == pytest.approx(added.x_px[0] + share * (added.x_px[2] - added.x_px[0]), abs=0.01)
    page.keyboard.press("z")
    saved(lambda labels: labels.ball.size == size)
    page.keyboard.press("Escape")
    dialog.wait_for(state="hidden")
    later_us = float(before.t_us[-1]) + 50_000  # no label near: a flight of its own
    playhead = "Object.defineProperty(Viewer.prototype, 'playhead_us', { get: () => at_us })"
    page.evaluate(
        f"async (at_us) => {{ const {{ Viewer }} = await import('/static/viewer.js'); {playhead}; }}", later_us
    )
    add, ask = page.get_by_role("button", name="Add one at the playhead"), "A new flight: click the ball's middle"
    add.click()
    dialog.get_by_text(ask).wait_for()
    page.keyboard.press("Escape")  # before it is placed: it is taken back
    page.get_by_text(f"{size} labels of 1 flights").wait_for()
    add.click()
    dialog.get_by_text(ask).wait_for()
    box = dialog.locator("svg").bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    saved(lambda labels: labels.ball.tolist() == [1] * size + [2] and labels.t_us[-1] == later_us)
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])  # it is placed, and not moved again
    placed = BallLabels.read(path)
    middle = open_recording(tuner.state.path)
    assert placed.x_px[-1] == pytest.approx((middle.width_px - 1) / 2, abs=2.0)
    assert placed.y_px[-1] == pytest.approx((middle.height_px - 1) / 2, abs=2.0)
    page.keyboard.press("Escape")
    dialog.wait_for(state="hidden")
    assert tab.errors == []
    page.context.close()
