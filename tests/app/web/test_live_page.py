"""Routes and panel of a running camera, with a stand-in behind them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from spinscope.app.tuning.bias_sweep import BiasRange, BiasState, BiasSweep, BiasSweepPoint, SweptBias
from spinscope.app.web.live_schemas import LiveRecording, LiveSecond, LiveShotRow, LiveView, NumberedNotice
from spinscope.pipeline.errors import CameraError, RecordingError
from spinscope.pipeline.registry import Parameters

from .browser_tab import Tab, needs_browser
from .conftest import Served, served


class StandIn:
    """A camera with one bias, which says what was asked of it."""

    def __init__(self, window: Path) -> None:
        self.locked: str | None = None
        self.notices: list[NumberedNotice] = []
        self.fault: str | None = None
        self.window, self.asked = window, list[object]()
        self.recording: LiveRecording | None = None

    def view(self) -> LiveView:
        second = dict.fromkeys(LiveSecond.model_fields, 1.0) | {"dropped": 2, "skipped": 0, "final_ms": None}
        shots = [LiveShotRow(text="12.0 rps", is_final=True, recording=self.window.name)]
        seconds = [LiveSecond.model_validate(second | {"t_s": float(t_s)}) for t_s in range(3)]
        return LiveView(
            camera="stand-in 1",
            is_running=True,
            fault=self.fault,
            kept_s=3.0,
            seconds=seconds,
            shots=shots,
            notices=self.notices,
            recording=self.recording,
        )

    def picture(self) -> bytes:
        return bytes(cv2.imencode(".png", np.zeros((36, 64), np.uint8))[1])

    def save_window(self, seconds: float) -> Path:
        self.asked.append(seconds)
        return self.window

    def set_recording(self, is_on: bool) -> None:
        self.recording = LiveRecording(file="today.raw", events=2_500_000, markers=0) if is_on else None

    def mark(self, text: str, seconds_ago: float) -> None:
        if self.recording is None:
            raise RecordingError("nothing is recorded")
        self.recording.markers += 1
        self.asked.append((text, seconds_ago < 60.0))

    def take_parameters(self, parameters: Parameters) -> None:
        self.asked.append(parameters.logo.pad_px)

    def bias_state(self) -> BiasState:
        ranges, swept = {"gain": BiasRange(0, 9, 3, "gain")}, [SweptBias("gain", "gain", ["gain"])]
        swept = swept if self.locked is None else []
        return BiasState({"gain": 3}, True, self.locked, True, ranges, swept, of_camera=True)

    def set_biases(self, biases: Mapping[str, int]) -> None:
        if biases["gain"] > 9:
            raise CameraError("bias gain is out of range")
        self.asked.append(dict(biases))

    def sweep_bias(
        self, name: str, points: int, report: Callable[[BiasSweep], None], check: Callable[[], None]
    ) -> BiasSweep:
        return BiasSweep(name, points, [BiasSweepPoint(value=4, noise_on_hz=1.0)], "proposed: gain = 4")


@pytest.fixture
def running(flight: Path) -> Iterator[tuple[Served, StandIn]]:
    live = StandIn(flight.with_name("flight_two_balls.h5"))
    made = served(flight, live=live)
    yield made, live
    made.stop()


def test_state_picture_parameters_and_the_last_seconds(running: tuple[Served, StandIn]) -> None:
    made, live = running
    with httpx.Client(base_url=made.address) as http:
        assert http.get("api/live/view").json()["camera"] == "stand-in 1"
        assert http.get("api/live/picture").content == live.picture()
        assert http.post("api/live/window", json={"seconds": 2.5}).json() == {"recording": live.window.name}
        assert http.post("api/live/window", json={"seconds": 0.0}).status_code == 422
        assert http.post("api/live/parameters", json={"parameters": {"logo": {"pad_px": 6.0}}}).status_code == 200
        assert http.post("api/live/parameters", json={"parameters": {"logo": {"pad_px": -6.0}}}).status_code == 400
        marker = {"text": "serve", "seconds_ago": 1.5}
        assert http.post("api/live/marker", json=marker).json()["error"] == "nothing is recorded"
        assert http.post("api/live/recording", json={"is_on": True}).json()["recording"]["file"] == "today.raw"
        assert http.post("api/live/marker", json=marker).json()["recording"]["markers"] == 1
        assert http.post("api/live/marker", json=marker | {"seconds_ago": -1.0}).status_code == 422
        assert http.post("api/live/recording", json={"is_on": False}).json()["recording"] is None
    assert live.asked == [2.5, 6.0, ("serve", True)]


def test_biases_act_on_the_camera(running: tuple[Served, StandIn]) -> None:
    made, live = running
    client = made.open()
    assert client.opening["is_live"] and client.opening["biases"]["of_camera"]
    assert client.post("biases", biases={"gain": 5}).status_code == 202
    client.wait("biases", lambda message: message["state"] == "done")
    refused = client.post("biases", biases={"gain": 10})
    assert refused.status_code == 400 and "out of range" in refused.json()["error"]
    assert live.asked == [{"gain": 5}]
    assert client.post("bias_sweep", biases={"gain": 5}, name="gain").status_code == 202
    done = client.wait("bias_sweep", lambda message: message["state"] == "done")
    assert done["content"]["proposal"] == "proposed: gain = 4" and done["content"]["points"][0]["value"] == 4


def test_without_a_camera_the_routes_say_so(tuner: Served) -> None:
    answer = httpx.get(f"{tuner.address}api/live/view")
    assert answer.status_code == 404 and "spinscope live" in answer.json()["error"]


@needs_browser[0]
@needs_browser[1]
def test_the_buttons_of_the_panel(browser: Any, running: tuple[Served, StandIn]) -> None:
    made, live = running
    tab = Tab(browser.new_page())
    tab.page.route(re.compile(r"re_viewer_bg\.wasm"), lambda route: route.abort())
    tab.open(made.address)
    panel = tab.panel("Live camera")
    panel.get_by_text("2 packets lost by the camera").wait_for()
    live.fault = "pulled out"
    panel.get_by_text("pulled out").wait_for()
    live.fault = None
    panel.get_by_text("pulled out").wait_for(state="hidden")
    for number in (1, 2):  # the same happens again
        live.notices = [NumberedNotice(number=number, text="unplugged")]
        tab.page.locator("#notices").get_by_text("unplugged").click()  # closes it
    assert panel.locator("svg path").count() == 8
    tab.until("document.querySelector('img.live').naturalWidth === 64")
    panel.get_by_text("Pause").click()
    panel.get_by_text("Go on").click()
    panel.get_by_text("Pause").wait_for()
    panel.get_by_text("Use the sliders from now on").click()
    tab.page.locator("#notices").get_by_text("go on with these settings").wait_for()
    tab.panel("Biases").locator("[data-bias=gain] input[type=range]").press("ArrowUp")
    tab.until("!document.querySelector('[data-bias=gain] input').disabled")
    tab.page.keyboard.press("r")
    panel.get_by_text("recording today.raw · 2.5 Mev").wait_for()
    tab.page.keyboard.press("m")
    tab.page.keyboard.type("serve\n")
    panel.get_by_text("· 1 marker").wait_for()
    panel.get_by_text("End the recording").click()
    panel.get_by_text("Record", exact=True).wait_for()
    panel.get_by_text("Look at them").click()
    tab.until(f"location.hash.includes('recording={live.window.name}')")
    tab.page.close()
    assert live.asked == [Parameters().logo.pad_px, {"gain": 4}, ("serve", True), 10.0] and not tab.errors


@needs_browser[0]
@needs_browser[1]
def test_biases_that_cannot_act_are_shown_and_cannot_be_moved(browser: Any, running: tuple[Served, StandIn]) -> None:
    made, live = running
    live.locked = "the events of a recording do not change"
    tab = Tab(browser.new_page())
    tab.page.route(re.compile(r"re_viewer_bg\.wasm"), lambda route: route.abort())
    tab.open(made.address)
    panel = tab.panel("Biases")
    assert panel.locator(".note").first.text_content() == live.locked
    assert panel.locator("[data-bias=gain] input:enabled").count() == 0
    assert panel.locator("button:visible, select:visible").count() == 0
    tab.page.close()
    assert not live.asked and not tab.errors
