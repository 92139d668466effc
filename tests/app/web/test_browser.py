"""The page in a real browser: with tools and without, sliders, playhead, A and B, charts, a server that goes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from spinscope.pipeline.registry import STAGES, default_stages, needed_stages
from spinscope.pipeline.simulated_recordings import simulate_to_file

from .browser_tab import SIZE, Tab, bare_tab, needs_browser, serious
from .conftest import Served, served

pytestmark = needs_browser

SLIDERS = [
    "filter.threshold_us",
    "surface.k_px",
    "track.coast_us",
    "logo.pad_px",
    "rate.ema_us",
    "flow.reach_px",
    "spin.max_spin_rps",
    "contrast.kernel_rad",
]


def test_every_group_of_sliders_changes_its_stages_and_nothing_above(tab: Tab) -> None:
    for name in SLIDERS:
        own = {one for one in default_stages() if STAGES[one].group == name.split(".")[0]}
        first = own | {stage.name for stage in STAGES if name in stage.reads}
        below = {stage.name for stage in STAGES if first & {one.name for one in needed_stages([stage.name])}}
        before = tab.value(name)
        tab.slide(name)
        assert tab.value(name) > before, name
        assert own <= tab.computed() <= below, name
        assert tab.page.locator(f"[data-name='{name}'].differs").count() == 1
        tab.after(lambda: tab.page.keyboard.press("Control+z"))
        assert tab.value(name) == before and tab.computed() == set()
    choice = tab.page.locator("[data-name='surface.cleaning'] select")
    choice.evaluate("(choice) => { choice.closest('details').open = true; }")
    tab.after(lambda: choice.select_option("off"))
    assert "surface" in tab.computed()
    tab.after(lambda: tab.page.locator("[data-name='surface.cleaning'] .reset").click())
    assert tab.value("surface.cleaning") == "isolated"


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


def test_typing_reset_undo_and_redo(tab: Tab) -> None:
    start = tab.value("logo.pad_px")
    box = tab.page.locator("[data-name='logo.pad_px'] input.number")

    def typed(text: str) -> None:
        box.fill(text)
        box.press("Enter")

    tab.after(lambda: typed("4.75"))
    assert tab.value("logo.pad_px") == 4.75
    typed("900")
    notice = tab.page.locator(".notice", has_text="0 to 100 px")
    notice.wait_for()
    assert tab.value("logo.pad_px") == 4.75
    notice.click()
    tab.after(lambda: tab.page.click("#undo"))
    assert tab.value("logo.pad_px") == start
    tab.after(lambda: tab.page.click("#redo"))
    assert tab.value("logo.pad_px") == 4.75
    tab.after(lambda: tab.page.locator("[data-name='logo.pad_px'] .reset").click())
    assert tab.page.locator(".control.differs").count() == 0


def test_values_that_do_not_go_together_are_taken_back(tab: Tab) -> None:
    low = tab.value("track.radius_min_px")
    tab.after(lambda: tab.page.evaluate("window.spinscope.settings.set('track.radius_min_px', 499)"))
    notice = tab.page.locator(".notice", has_text="radius")
    notice.wait_for()
    assert tab.value("track.radius_min_px") == low
    notice.click()


def test_a_and_b_beside_each_other(tab: Tab) -> None:
    tab.after(lambda: tab.page.click("#pin"))
    tab.slide("logo.pad_px", "PageUp")
    text = tab.page.inner_text("#side details[data-title='Result']")
    assert "logo.pad_px" in text
    headings = tab.page.locator("#side tr.heading th").all_inner_texts()
    assert "A" in headings and "B" in headings and "B − A" in headings
    assert re.search(r"\d° apart", tab.page.inner_text("#side details[data-title='Result']"))
    changed = tab.value("logo.pad_px")
    tab.after(lambda: tab.page.click("#swap"))
    assert tab.value("logo.pad_px") != changed
    tab.after(lambda: tab.page.click("#discard"))
    assert tab.value("logo.pad_px") == changed
    assert tab.page.locator("#swap").is_hidden()
    tab.after(lambda: tab.page.locator("[data-name='logo.pad_px'] .reset").click())


def test_a_preset_is_taken_and_marks_follow_it(tab: Tab) -> None:
    tab.after(lambda: tab.page.select_option("#preset", "paper"))
    assert tab.value("filter.logo_mode") == "stc_cut_trail"
    assert tab.page.locator(".control.differs").count() == 0
    tab.slide("logo.pad_px")
    assert tab.page.locator(".control.differs").count() == 1
    tab.after(lambda: tab.page.click("#undo"))
    tab.after(lambda: tab.page.click("#undo"))
    assert tab.page.input_value("#preset") == "opened"
    assert tab.page.locator(".control.differs").count() == 0


def test_a_file_named_like_a_preset_of_ours_does_not_take_its_place(tab: Tab, tmp_path: Path) -> None:
    (tmp_path / "paper.toml").write_text("[logo]\npad_px = 4.25\n", encoding="utf-8")
    paper = tab.page.evaluate("JSON.stringify(window.spinscope.opening.presets.paper)")
    tab.after(lambda: tab.page.set_input_files("#save input[type=file]", tmp_path / "paper.toml"))
    assert tab.value("logo.pad_px") == 4.25
    assert tab.page.input_value("#preset") == "paper.toml"
    assert tab.page.evaluate("JSON.stringify(window.spinscope.opening.presets.paper)") == paper
    tab.after(lambda: tab.page.select_option("#preset", "opened"))


def test_a_point_of_a_sweep_is_taken_by_a_click(tab: Tab) -> None:
    panel = tab.panel("Parameter sweep")
    panel.locator("input[aria-label=from]").fill("2")
    panel.locator("input[aria-label=to]").fill("5")
    panel.locator("input[aria-label=points]").fill("4")
    panel.locator("button.primary").click()
    tab.until("document.querySelectorAll('#side .chart .trace:first-child .point').length >= 4")
    panel.locator("progress").wait_for(state="hidden")
    titles = panel.locator(".chart:visible").evaluate_all("all => all.map((one) => one.getAttribute('aria-label'))")
    assert {"Spin", "Logo events", "Track jitter", "Error against truth"} <= set(titles)
    assert "logo.pad_px [px]" in panel.locator(".chart >> nth=0").text_content()
    chart = panel.locator(".chart[aria-label='Logo events']")
    point = chart.locator(".point").last

    with tab.page.expect_download() as saved:
        chart.locator(".modebar-btn").click(force=True)
    assert saved.value.suggested_filename == "logo_events.svg"
    assert Path(saved.value.path()).read_text(encoding="utf-8").startswith("<svg")

    def click() -> None:
        point.scroll_into_view_if_needed()
        box = point.bounding_box()
        tab.page.mouse.move(box["x"] + 1, box["y"] + 1)
        tab.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        chart.locator(".hovertext").first.wait_for(state="attached")
        tab.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    tab.after(click)
    assert tab.value("logo.pad_px") == 5
    tab.after(lambda: tab.page.click("#undo"))


def test_an_optimization_shows_the_best_values_and_leads_back(tab: Tab) -> None:
    panel = tab.panel("Optimization")
    panel.locator("input[aria-label=trials]").fill("4")
    before = tab.page.evaluate("JSON.stringify(window.spinscope.settings.parameters)")
    panel.locator("button.primary").first.click()
    take = panel.get_by_text("Apply the best values")
    take.wait_for()
    panel.locator("progress").wait_for(state="hidden")
    take.click()
    panel.get_by_text("Restore the previous values").click()
    assert tab.page.evaluate("JSON.stringify(window.spinscope.settings.parameters)") == before


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
    sentence = r"Topspin \d+ ±[\d.]+ rps \(\d+ rpm\) \d+ km/h, axis tilted \d+° from pure topspin, whole shot"
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


def test_the_panes_follow_a_ball_that_is_fixed_and_flies_again(tab: Tab) -> None:
    """The layout is made anew for the mode, and the tab stays."""
    tab.settled("shown")
    asked = len([url for url in tab.requests if "/layout?" in url])
    circle = {"ball": "fixed", "fixed_x_px": 600, "fixed_y_px": 300, "fixed_radius_px": 60}
    tab.after(lambda: tab.page.evaluate("(track) => window.spinscope.settings.setAll({ track })", circle), "shown")
    tab.after(lambda: tab.page.keyboard.press("z"), "shown")
    assert len([url for url in tab.requests if "/layout?" in url]) == asked + 2
    assert tab.page.evaluate("window.spinscope.viewer.tab()") == "Tracker"


def test_nothing_was_fetched_from_elsewhere_and_nothing_went_wrong(tab: Tab, server: Served) -> None:
    own = (server.address, "blob:", "data:")
    assert [url for url in tab.requests if not url.startswith(own)] == []
    assert tab.errors == []
    assert tab.page.evaluate("window.violations") == []


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
        assert shown == {one["label"] for one in tab.page.evaluate("window.spinscope.opening.tabs")}
        assert "Compare" not in shown
        assert tab.where()["play"] == "paused"
        assert tab.errors == [] and tab.page.evaluate("window.violations") == []
        context.close()
    finally:
        own.stop()


def test_settings_are_found_by_words_and_what_differs_is_in_sight(browser: Any, server: Served) -> None:
    """Without the viewer: the essentials, the search, the list of what differs, an address that sets nonsense."""
    tab = bare_tab(browser, f"{server.address}#set=contrast.kernel_rad=0.05&set=__proto__.polluted=1")
    page = tab.page
    assert "which is no setting" in page.inner_text("#notices")
    assert page.evaluate("[{}.polluted, Object.prototype.polluted].every((one) => one === undefined)")
    chip = page.locator("#changed .chip")
    assert chip.all_inner_texts() == ["contrast.kernel_rad = 0.05 rad"]
    row, pad = page.locator("[data-name='contrast.kernel_rad']"), page.locator("[data-name='logo.pad_px']")
    assert pad.is_visible() and not row.is_visible()
    page.fill("#search", "sigma near BALL")
    assert row.is_visible() and not pad.is_visible()
    page.fill("#search", "")
    assert pad.is_visible() and not row.is_visible()
    chip.click()
    assert row.is_visible() and chip.is_visible()
    tab.after(lambda: row.locator(".reset").click())
    assert page.locator("#changed").is_hidden()
    assert tab.errors == []
    page.context.close()


def test_the_tools_of_a_page_can_be_turned_off(browser: Any, server: Served) -> None:
    tab = bare_tab(browser, f"{server.address}?tools=off#set=logo.pad_px=3.5")
    assert tab.page.locator("header").is_hidden() and tab.page.locator("#controls").is_hidden()
    assert tab.value("logo.pad_px") == 3.5
    tab.page.context.close()


def test_two_tabs_and_a_reload(browser: Any, tab: Tab, server: Served) -> None:
    other = bare_tab(browser, server.address)
    mine = tab.value("logo.pad_px")
    other.slide("logo.pad_px", "PageUp")
    changed = other.value("logo.pad_px")
    assert changed > mine and tab.value("logo.pad_px") == mine
    other.page.wait_for_url(re.compile(r"set=logo\.pad_px"))
    other.page.reload()
    other.page.wait_for_selector("body[data-done]", state="attached")
    assert other.value("logo.pad_px") == changed
    other.page.goto("about:blank")
    other.open(f"{server.address}#set=logo.pad_px=-5&set=nothing.at=1&clip=7-3")
    other.settled()
    assert other.value("logo.pad_px") == mine  # a mangled link opens the recording all the same
    other.page.goto("about:blank")
    other.open(f"{server.address}#set=contrast.weakest=0.3&set=__proto__.weakest=1")
    other.settled()
    assert other.value("contrast.min_gain") == 0.3  # a link with a parameter's former name
    assert "contrast.weakest is now called contrast.min_gain" in other.page.inner_text("#notices")
    other.page.context.close()


def test_a_simulated_scene_is_simulated_again_from_the_page(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "spinner.h5"
    simulate_to_file("spinner", path, duration_ms=25.0, width_px=320, height_px=240)
    own = served(path)
    try:
        tab = bare_tab(browser, own.address)
        before = tab.page.inner_text("#about")
        panel = tab.panel("Biases")
        slider = panel.locator("[data-bias=diff_on] input[type=range]")
        tab.after(lambda: slider.press("End"))
        assert tab.page.inner_text("#about") != before
        # Refractory periods hardly change when the first and last event come: the results are new all the same.
        tab.after(lambda: panel.locator("[data-bias=refr] input[type=range]").press("ArrowUp"))
        # What is cancelled leaves the biases that the events have; the server's word comes from here, in time.
        values = tab.page.evaluate(
            """() => {
                const { biases, connection } = window.spinscope, ask = window.fetch;
                const before = { ...biases.values };
                window.fetch = () => new Promise(() => {});
                biases.take({ diff_off: 150 });
                const wanted = { ...biases.values };
                biases.stop.click();
                connection.dispatchEvent(new CustomEvent("biases", { detail: { state: "cancelled" } }));
                window.fetch = ask;
                return [before, wanted, { ...biases.values }];
            }"""
        )
        before_it, wanted, after_it = values
        assert wanted == {**before_it, "diff_off": 150} != before_it
        assert after_it == before_it
        panel.get_by_text("Sweep this bias").click()
        panel.locator(".chart .point").first.wait_for()
        panel.locator("progress").wait_for(state="hidden")
        assert panel.locator(".chart").count() == 2
        tab.until("document.querySelectorAll('.chart .shapelayer path').length === 2")  # the present value
        assert tab.page.evaluate("window.violations") == []
        tab.page.context.close()
    finally:
        own.stop()


def test_the_page_says_that_the_server_is_gone_and_comes_back(browser: Any, flight: Path) -> None:
    first = served(flight)
    tab = bare_tab(browser, first.address)
    tab.slide("logo.pad_px")
    value = tab.value("logo.pad_px")
    port = int(first.address.rsplit(":", 1)[1].strip("/"))
    first.stop()
    tab.page.wait_for_selector("body.lost", state="attached")
    assert "does not answer" in tab.page.inner_text("#bar")
    second = served(flight, port)
    try:
        tab.page.wait_for_selector("body:not(.lost)", state="attached")
        tab.settled()
        assert tab.value("logo.pad_px") == value
        tab.slide("logo.pad_px")
        tab.page.context.close()
    finally:
        second.stop()
