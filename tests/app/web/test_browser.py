"""The page with its viewer in a real browser: playhead, layout, pictures, keys, links; with tools and without."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from .browser_tab import SIZE, Tab, needs_browser, serious
from .conftest import Served, served

pytestmark = needs_browser


def test_the_playhead_stays_where_it_is_paused_and_playing(tab: Tab) -> None:
    tab.settled("shown")
    tab.page.evaluate("window.spinscope.viewer.seek(52345)")
    tab.slide("logo.pad_px", what="shown")
    where = tab.where()
    assert where == {"time": 52345, "play": "paused"}
    # It plays 100 times slower and over and over: 90 ms take nine seconds.
    tab.page.evaluate("window.spinscope.viewer.seek(6345)")
    tab.page.evaluate("window.spinscope.viewer.play('playing')")
    tab.slide("logo.pad_px", what="shown")
    assert tab.where()["play"] == "playing"
    assert tab.where()["time"] != 6345
    tab.page.evaluate("window.spinscope.viewer.play('paused')")
    count = tab.page.evaluate("window.spinscope.viewer.api.get_state().then((state) => state.recordings.length)")
    assert count == 1  # the old recordings are closed
    assert tab.page.evaluate("window.spinscope.viewer.tab()") == "Tracker"


def test_the_page_knows_the_playhead_without_asking_the_viewer(tab: Tab) -> None:
    """Each question would have it painted anew; it follows a click in the strip and what the viewer plays."""
    tab.page.evaluate("window.spinscope.viewer.seek(40000)")
    tab.until("window.spinscope.viewer.playhead_us === 40000")
    asked = """(() => {
        const api = window.spinscope.viewer.api, ask = api.get_state.bind(api);
        window.asked = 0;
        api.get_state = () => (window.asked++, ask());
    })()"""
    tab.page.evaluate(asked)
    box = tab.page.locator("#overview svg").bounding_box()
    tab.page.mouse.click(box["x"] + 0.7 * box["width"], box["y"] + 20)
    tab.until("window.spinscope.viewer.playhead_us > 60000")
    assert tab.page.evaluate("window.asked") == 0
    tab.slide("logo.pad_px", what="shown")
    assert tab.where()["time"] == tab.page.evaluate("window.spinscope.viewer.playhead_us")


def test_a_changed_playback_speed_survives_a_change(tab: Tab) -> None:
    change = """(async () => {
        const { viewer } = window.spinscope, { api } = viewer;
        const { blueprint } = await api.get_blueprint(), { active_store_id } = await api.get_state();
        blueprint["/time_panel"].TimePanelBlueprint.playback_speed = 0.05;
        await api.set_blueprint(blueprint, { kind: "recording", recording: active_store_id });
    })()"""
    speed = (
        "window.spinscope.viewer.api.get_blueprint()"
        '.then(({ blueprint }) => blueprint["/time_panel"].TimePanelBlueprint.playback_speed)'
    )
    assert tab.page.evaluate(speed) == pytest.approx(0.01)
    tab.page.evaluate(change)
    tab.until(f"{speed}.then((found) => Math.abs(found - 0.05) < 1e-6)")
    tab.slide("logo.pad_px", what="shown")
    assert tab.page.evaluate(speed) == pytest.approx(0.05)


def test_it_plays_over_and_over_after_a_change_too(tab: Tab) -> None:
    tab.slide("logo.pad_px", what="shown")
    tab.page.evaluate("window.spinscope.viewer.seek(94500, 'playing')")
    tab.until("window.spinscope.viewer.playhead_us < 50000")
    tab.page.evaluate("window.spinscope.viewer.play('paused')")


def test_the_picture_of_the_view_is_saved(tab: Tab) -> None:
    with tab.page.expect_download() as download:
        tab.page.evaluate(
            "[...document.querySelectorAll('#save .items button')].find((b) => b.textContent.includes('PNG')).click()"
        )
    picture = cv2.imread(str(download.value.path()))
    box = tab.page.locator("#viewer canvas").bounding_box()
    assert picture.shape[2] == 3 and np.allclose(picture.shape[:2], (box["height"], box["width"]), atol=1)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    assert (picture.max(axis=2) > 200).mean() > 0.002  # letters and curves


def test_a_smaller_and_a_larger_window_hold_the_whole_page(tab: Tab) -> None:
    try:
        with tab.page.expect_request(lambda request: "layout?" in request.url):  # with panes for the new size
            for height in (500, 700):
                tab.page.set_viewport_size({**SIZE, "height": height})
                end = "document.getElementById('bar').getBoundingClientRect().bottom"
                tab.until(f"Math.abs({end} - {height}) <= 1")
    finally:
        tab.page.set_viewport_size(SIZE)


def test_a_viewer_that_does_not_know_a_recordings_times_yet_is_asked_again(tab: Tab) -> None:
    """It may tell that a recording is open before that; rarely, so here it is made to."""
    tab.page.evaluate(
        """(() => {
            const viewer = window.spinscope.viewer.api;
            window.refused = 0;
            viewer.set_time = (where) => {
                if (++window.refused < 3) return Promise.reject(new Error("the recording has no timelines yet"));
                delete viewer.set_time;
                return viewer.set_time(where);
            };
        })()"""
    )
    tab.slide("logo.pad_px", what="shown")
    assert tab.page.evaluate("window.refused") == 3
    assert not tab.errors


def test_the_coach_sees_the_shot_alone(tab: Tab) -> None:
    tab.settled("shown")
    tab.page.click("#coach")
    tab.page.wait_for_selector("#leave", state="visible")
    views = (
        "window.spinscope.viewer.api.get_blueprint()"
        ".then((b) => Object.keys(b.blueprint).filter((p) => /^.view.[^/]+$/.test(p)).length)"
    )
    tab.until(f"{views}.then((count) => count <= 3)")  # ball and flight; what was left out may be there, unseen
    assert tab.page.locator("#controls").is_hidden()
    said = " ".join(tab.page.inner_text("#sentence").split())
    sentence = r"Topspin [\d.]+ ± [\d.]+ rps \(\d+ rpm\) \d+ km/h, axis tilted \d+° from pure topspin, whole shot"
    assert re.fullmatch(sentence, said), said
    tab.page.click("#leave")
    tab.page.wait_for_selector("#controls", state="visible")
    tab.until(f"{views}.then((count) => count > 3)")
    assert tab.page.evaluate("window.spinscope.viewer.tab()") == "Tracker"


def test_the_viewer_obeys_the_keys_of_the_page_and_lets_go_of_the_focus(tab: Tab) -> None:
    page, tick_us = tab.page, tab.value("track.tick_us")
    tab.settled("shown")
    page.evaluate("window.spinscope.viewer.seek(40000)")
    tab.until("window.spinscope.viewer.playhead_us === 40000")
    canvas = page.locator("#viewer canvas")
    assert canvas.get_attribute("role") == "application" and canvas.get_attribute("aria-label")
    canvas.focus()
    start_us, end_us = page.evaluate("window.spinscope.settings.clip")
    shot_us = page.evaluate("window.spinscope.overview.shots[0][0]")
    keys = {"ArrowRight": 40000 + tick_us, "ArrowLeft": 40000, "PageUp": shot_us, "End": end_us, "Home": start_us}
    for key, there_us in keys.items():
        page.keyboard.press(key)
        tab.until(f"window.spinscope.viewer.playhead_us === {there_us}")
    page.keyboard.press("4")
    tab.until("window.spinscope.viewer.tab().then((title) => title === 'Spin')")
    page.keyboard.press("2")
    tab.until("window.spinscope.viewer.tab().then((title) => title === 'Tracker')")
    page.keyboard.press("Escape")
    strip = page.locator("#overview svg")
    assert strip.evaluate("(strip) => strip === document.activeElement")
    assert strip.get_attribute("aria-valuenow") == str(start_us)
    page.keyboard.press("Tab")
    assert canvas.evaluate("(canvas) => canvas === document.activeElement")
    for key in ("Tab", "Shift+Tab"):
        canvas.focus()
        page.keyboard.press(key)
        assert canvas.evaluate("(canvas) => canvas !== document.activeElement"), key
    assert serious(page) == []
    page.keyboard.press("f")
    page.locator("header").wait_for(state="hidden")
    page.keyboard.press("f")
    page.locator("header").wait_for(state="visible")


def test_a_pasted_link_turns_to_its_tab_and_time_and_back_leads_back(tab: Tab) -> None:
    page = tab.page
    tab.settled("shown")
    page.evaluate("window.spinscope.viewer.place(40000)")
    page.wait_for_url(re.compile(r"t=40000&tab=Tracker"))
    page.evaluate("window.isSamePage = true; location.hash = 'tab=Spin&t=52000'")
    tab.until("window.spinscope.viewer.front === 'Spin' && window.spinscope.viewer.playhead_us === 52000")
    page.go_back()
    tab.until("window.spinscope.viewer.front === 'Tracker' && window.spinscope.viewer.playhead_us === 40000")
    assert page.evaluate("window.isSamePage")


def test_a_layout_that_was_asked_for_before_another_tab_was_chosen_leaves_that_in_front(tab: Tab) -> None:
    front = tab.page.evaluate(
        """(async () => {
            const { connection, viewer } = window.spinscope;
            await viewer.bringToFront("Tracker");
            const layout = await connection.layout("tab=Tracker&width_px=500&height_px=300");
            await viewer.bringToFront("Coach");
            await viewer.layout(layout);
            const front = await viewer.tab();
            await viewer.bringToFront("Tracker");
            return front;
        })()"""
    )
    assert front == "Coach"


def test_a_tab_that_is_chosen_while_the_first_layout_is_awaited_is_in_front_of_it(tab: Tab) -> None:
    """As is one that was chosen before; the layout comes when there is one of the viewer's own."""
    front = tab.page.evaluate(
        """(async () => {
            const { viewer } = window.spinscope, { api } = viewer;
            let asked = 0;
            await viewer.bringToFront("Tracker");
            api.get_blueprint = () => (asked++, { blueprint: {} });
            viewer.laidOut(0);
            const came = viewer.laidOut();
            while (asked < 3) await new Promise((resolve) => setTimeout(resolve, 10));
            const chosen = viewer.bringToFront("Coach");
            delete api.get_blueprint;
            const front = [await came, viewer.front];
            await chosen;
            front.push(await viewer.tab());
            await viewer.bringToFront("Tracker");
            return front;
        })()"""
    )
    assert front == [True, "Coach", "Coach"]


def test_while_a_slider_is_dragged_the_viewer_paints_only_what_is_asked_of_it(tab: Tab) -> None:
    """In software its pictures would take the time in which the previews are to be seen."""
    tab.settled("shown")
    rests = tab.page.evaluate(
        """(() => {
            const { settings, viewer } = window.spinscope, rests = [], pad = settings.get("logo.pad_px");
            viewer.rest = (ms) => rests.push(ms);
            for (const settled of [false, true]) settings.set("logo.pad_px", pad + 0.1, settled);
            delete viewer.rest;
            return rests;
        })()"""
    )
    assert rests[0] > 0 and rests[1] == 0
    tab.settled("shown")
    tab.page.evaluate(
        """(() => {
            const made = WebGL2RenderingContext.prototype;
            for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
                const draw = made[name];
                made[name] = function (...given) {
                    window.painted++;
                    return draw.apply(this, given);
                };
            }
        })()"""
    )
    moved = """(() => {
        const place = { bubbles: true, clientX: 300 + Math.random(), clientY: 200 };
        window.spinscope.viewer.api.canvas.dispatchEvent(new PointerEvent("pointermove", place));
    })()"""
    frames = """(async () => {
        for (let i = 0; i < 3; i++) await document.body.animate([], 1).finished;
    })()"""
    tab.page.evaluate("window.spinscope.viewer.rest(1e9)")
    tab.page.evaluate(frames)  # one may have been given to it before
    tab.page.evaluate("window.painted = 0")
    tab.page.evaluate(moved)
    tab.page.evaluate(frames)
    assert tab.page.evaluate("window.painted") == 0
    tab.page.evaluate("new Promise(requestAnimationFrame)")  # the rest of the page does not rest
    tab.page.evaluate("window.spinscope.viewer.rest = () => {}")
    tab.slide("logo.pad_px", what="shown")  # a picture is asked of it
    tab.page.evaluate("delete window.spinscope.viewer.rest; window.spinscope.viewer.rest(0); window.painted = 0")
    tab.page.evaluate(moved)
    tab.until("window.painted > 0")


def test_the_panes_follow_a_ball_that_is_fixed_and_flies_again(tab: Tab) -> None:
    """The layout is made anew for the mode, and the tab stays."""
    tab.settled("shown")
    asked = len([url for url in tab.requests if "/layout?" in url])
    circle = {"ball": "fixed", "fixed_x_px": 600, "fixed_y_px": 300, "fixed_radius_px": 60}
    tab.after(lambda: tab.page.evaluate("(track) => window.spinscope.settings.setAll({ track })", circle), "shown")
    tab.after(lambda: tab.page.keyboard.press("z"), "shown")
    assert len([url for url in tab.requests if "/layout?" in url]) == asked + 2
    assert tab.page.evaluate("window.spinscope.viewer.tab()") == "Tracker"


def test_nothing_was_fetched_from_elsewhere_and_nothing_went_wrong(tab: Tab, tuner: Served) -> None:
    own = (tuner.address, "blob:", "data:")
    assert [url for url in tab.requests if not url.startswith(own)] == []
    assert tab.errors == []
    assert tab.page.evaluate("window.violations") == []


@pytest.mark.slow  # a viewer of its own
def test_without_tools_the_viewer_fills_the_page_on_the_chosen_tab(browser: Any, flight: Path) -> None:
    own = served(flight, tools=False, layout="tracker")
    try:
        context = browser.new_context(viewport=SIZE)
        tab = Tab(context.new_page())
        tab.open(own.address)
        tab.settled("shown")
        for hidden in ("header", "#controls", "#side", "#bar", "#overview", "#progress"):
            assert tab.page.locator(hidden).is_hidden(), hidden
        box = tab.page.locator("#viewer canvas").bounding_box()
        assert (box["x"], box["y"], box["width"], box["height"]) == (0, 0, SIZE["width"], SIZE["height"])
        assert tab.page.evaluate("window.spinscope.viewer.tab()") == "Tracker"
        titles = """window.spinscope.viewer.api.get_blueprint().then(({ blueprint }) =>
            Object.values(blueprint).map((one) => one.ContainerBlueprint?.display_name).filter(Boolean))"""
        shown = set(tab.page.evaluate(titles))
        assert shown >= {one["label"] for one in tab.page.evaluate("window.spinscope.opening.tabs")}
        assert "Compare" not in shown
        assert tab.where()["play"] == "paused"
        assert tab.errors == [] and tab.page.evaluate("window.violations") == []
        context.close()
    finally:
        own.stop()


@pytest.mark.slow  # a viewer of its own
def test_layouts_that_are_lost_while_the_viewer_starts_are_made_again(browser: Any, tuner: Served) -> None:
    context = browser.new_context(viewport=SIZE)
    tab, lost = Tab(context.new_page()), list[str]()

    def lose_two(route: Any) -> None:
        if len(lost) == 2:
            return route.continue_()
        lost.append(route.request.url)
        return route.fulfill(body=b"", content_type="application/octet-stream")

    tab.page.route(re.compile(r"/layout\?"), lose_two)
    tab.open(f"{tuner.address}#tab=Tracker")
    tab.until("window.spinscope.viewer.playhead_us !== null")  # the picture has come, the layout has not
    tab.page.evaluate("window.spinscope.viewer.bringToFront('Coach')")
    tab.settled("shown")
    assert len(lost) == 2 and tab.page.evaluate("window.spinscope.viewer.tab()") == "Coach"
    context.close()


def test_a_picture_that_a_newer_one_overtakes_is_not_shown(tab: Tab) -> None:
    """The first one is held in the viewer until two more wait behind it."""
    tab.page.evaluate(
        """(() => {
            const { viewer } = window.spinscope, { api } = viewer, show = viewer.show.bind(viewer);
            const released = new Promise((resolve) => { window.release = resolve; });
            window.shows = [];
            viewer.show = async (...picture) => {
                const row = [picture[1], null];
                window.shows.push(row);
                return row[1] = await show(...picture);
            };
            api.set_time = async (where) => {
                await released;
                delete api.set_time;
                return api.set_time(where);
            };
        })()"""
    )
    newest = ""
    for pad in (5.1, 5.3, 5.5):
        before = tab.serial
        tab.page.evaluate(f"window.spinscope.settings.set('logo.pad_px', {pad}, true)")
        tab.until(f"window.spinscope.runner.serial > {before}")
        newest = tab.page.evaluate("`${window.spinscope.connection.session}-${window.spinscope.runner.serial}`")
        tab.until(f"window.shows.some(([id]) => id.startsWith('{newest}'))")
    tab.page.evaluate("window.release()")
    tab.settled("shown")
    first, *later = tab.page.evaluate("window.shows")
    assert first[1]
    assert len(later) >= 2 and all(is_shown == name.startswith(newest) for name, is_shown in (later[0], later[-1]))
    assert all(name.startswith(newest) for name, is_shown in later if is_shown)  # a part of it may come before it
    tab.page.evaluate("delete window.spinscope.viewer.show")
