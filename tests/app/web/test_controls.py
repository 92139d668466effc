"""The page's controls in a real browser: sliders, A and B, presets, charts, a server that goes; without the viewer."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from spinscope.pipeline.registry import STAGES, default_stages, needed_stages
from spinscope.pipeline.simulated_recordings import simulate_to_file

from .browser_tab import SIZE, Tab, bare_tab, needs_browser
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


def test_every_group_of_sliders_changes_its_stages_and_nothing_above(bare: Tab) -> None:
    for name in SLIDERS:
        own = {one for one in default_stages() if STAGES[one].group == name.split(".")[0]}
        first = own | {stage.name for stage in STAGES if name in stage.reads}
        below = {stage.name for stage in STAGES if first & {one.name for one in needed_stages([stage.name])}}
        before = bare.value(name)
        bare.slide(name)
        assert bare.value(name) > before, name
        assert own <= bare.computed() <= below, name
        assert bare.page.locator(f"[data-name='{name}'].differs").count() == 1
        bare.after(lambda: bare.page.keyboard.press("Control+z"))
        assert bare.value(name) == before and bare.computed() == set()
    choice = bare.page.locator("[data-name='surface.cleaning'] select")
    choice.evaluate("(choice) => { choice.closest('details').open = true; }")
    bare.after(lambda: choice.select_option("off"))
    assert "surface" in bare.computed()
    bare.after(lambda: bare.page.locator("[data-name='surface.cleaning'] .reset").click())
    assert bare.value("surface.cleaning") == "isolated"


def test_previews_follow_a_slider_that_is_dragged_without_a_rest(bare: Tab) -> None:
    requests: list[Any] = []
    bare.page.on("request", lambda one: requests.append(one.post_data_json) if one.url.endswith("/run") else None)
    bare.page.evaluate(
        """(() => {
            const slider = document.querySelector("[data-name='logo.pad_px'] input[type=range]");
            const start = Number(slider.value);
            let moves = 0;
            window.previews = 0;
            const watch = new MutationObserver(() => ++window.previews);
            watch.observe(document.querySelector("#preview img"), { attributeFilter: ["src"] });
            const move = () => {
                slider.value = start + (++moves % 9) * slider.step;
                slider.dispatchEvent(new Event("input", { bubbles: true }));
            };
            const drag = setInterval(move, 10);
            window.letGo = () => {
                clearInterval(drag);
                watch.disconnect();
                slider.value = start;
                for (const name of ["input", "change"]) slider.dispatchEvent(new Event(name, { bubbles: true }));
            };
        })()"""
    )
    bare.until("window.previews >= 5")
    bare.page.evaluate("window.letGo()")
    bare.settled()
    assert bare.page.locator(".control.differs").count() == 0
    # What is computed for them ends at the picture that is seen.
    assert all(one["playhead_us"] is not None for one in requests if one["interactive"])


def test_typing_reset_undo_and_redo(bare: Tab) -> None:
    start = bare.value("logo.pad_px")
    box = bare.page.locator("[data-name='logo.pad_px'] input.number")

    def typed(text: str) -> None:
        box.fill(text)
        box.press("Enter")

    bare.after(lambda: typed("4.75"))
    assert bare.value("logo.pad_px") == 4.75
    typed("900")
    notice = bare.page.locator(".notice", has_text="0 to 100 px")
    notice.wait_for()
    assert bare.value("logo.pad_px") == 4.75
    notice.click()
    bare.after(lambda: bare.page.click("#undo"))
    assert bare.value("logo.pad_px") == start
    bare.after(lambda: bare.page.click("#redo"))
    assert bare.value("logo.pad_px") == 4.75
    bare.after(lambda: bare.page.locator("[data-name='logo.pad_px'] .reset").click())
    assert bare.page.locator(".control.differs").count() == 0
    bare.slide("logo.pad_px", "End")  # of the slider, which ends inside of the ball
    top = bare.page.evaluate("window.spinscope.controls.controls.get('logo.pad_px').top")
    assert bare.value("logo.pad_px") == top < 100
    bare.after(lambda: bare.page.click("#undo"))


def test_values_that_do_not_go_together_are_taken_back(bare: Tab) -> None:
    low = bare.value("track.radius_min_px")
    bare.after(lambda: bare.page.evaluate("window.spinscope.settings.set('track.radius_min_px', 499)"))
    notice = bare.page.locator(".notice", has_text="radius")
    notice.wait_for()
    assert bare.value("track.radius_min_px") == low
    notice.click()


def test_the_results_are_of_the_shot_that_is_seen_at_the_playhead(bare: Tab) -> None:
    bare.page.evaluate(
        """window.spinscope.connection.addEventListener("run", ({ detail }) => {
            if (detail.metrics) window.told = detail;
        })"""
    )
    bare.slide("logo.pad_px")
    bare.page.evaluate(
        """(() => {
            const { metrics, picture, ...rest } = window.told, [shot] = metrics.shots;
            const doubtful = { ...shot, sentence: "One", best: null, best_reason: "of a test" };
            const detail = {
                ...rest,
                metrics: { ...metrics, shots: [doubtful, { ...shot, sentence: "Two" }] },
                picture: { ...picture, seen_shots: [[[20000, 1], [50000, 2]]] },
            };
            window.spinscope.runner.dispatchEvent(new CustomEvent("numbers", { detail }));
        })()"""
    )
    for t_us, said in ((10000, "One"), (49999, "One"), (50000, "Two"), (20000, "One")):
        bare.page.evaluate(f"window.spinscope.viewer.place({t_us})")
        text = bare.page.inner_text("#side details[data-title='Result']")
        assert bare.page.inner_text("#side p.answer").startswith(f"{said} · whole shot")
        assert f"shot {1 + (said == 'Two')} of 2" in text
        assert ("No spin is trusted: of a test" in text) == (said == "One")
        assert bare.page.evaluate("window.spinscope.results.sentence") == said
    bare.after(lambda: bare.page.keyboard.press("Control+z"))


def test_a_picture_that_the_viewer_does_not_show_is_said(bare: Tab) -> None:
    """One of a part of the run is not asked for before there is a layout, which is of the whole run."""
    bare.page.evaluate(
        """(() => {
            const { connection, runner, viewer } = window.spinscope;
            runner.isBlind = false;
            viewer.layout = () => Promise.resolve();
            viewer.show = () => Promise.reject(new Error("it sleeps"));
            const detail = { serial: runner.serial, state: "partial", picture: { id: "early" } };
            connection.dispatchEvent(new CustomEvent("run", { detail }));
        })()"""
    )
    bare.slide("logo.pad_px")
    notice = bare.page.locator(".notice", has_text="does not show the newest picture: it sleeps")
    notice.wait_for()
    bare.until("!window.spinscope.runner.isWaiting")
    pictures = [url for url in bare.requests if "/pictures/" in url]
    assert pictures and not any(url.endswith("early") for url in pictures)
    bare.page.evaluate(
        "(({ runner, viewer }) => (delete viewer.layout, delete viewer.show, runner.isBlind = true))(window.spinscope)"
    )
    notice.click()
    bare.after(lambda: bare.page.keyboard.press("Control+z"))


def test_a_and_b_beside_each_other(bare: Tab) -> None:
    bare.after(lambda: bare.page.click("#pin"))
    bare.slide("logo.pad_px", "PageUp")
    text = bare.page.inner_text("#side details[data-title='Result']")
    assert "logo.pad_px" in text
    witness = r"Witnesses of the combined answer\n.*\npattern\t[\d.]+ ± [\d.]+ rps\t[\d.]+ ± [\d.]+ rps\t[−\d.]+ rps\n"
    assert re.search(witness, text, re.DOTALL)
    answers = bare.page.locator("#side .answer").all_inner_texts()
    assert [answer[:3] for answer in answers] == ["A: ", "B: "] and all("whole shot, by " in one for one in answers)
    headings = bare.page.locator("#side tr.heading th").all_inner_texts()
    assert "A" in headings and "B" in headings and "B − A" in headings
    assert re.search(r"\d° apart", bare.page.inner_text("#side details[data-title='Result']"))
    changed = bare.value("logo.pad_px")
    bare.after(lambda: bare.page.click("#swap"))
    assert bare.value("logo.pad_px") != changed
    bare.after(lambda: bare.page.click("#discard"))
    assert bare.value("logo.pad_px") == changed
    assert bare.page.locator("#swap").is_hidden()
    bare.after(lambda: bare.page.locator("[data-name='logo.pad_px'] .reset").click())


def test_a_preset_is_taken_and_marks_follow_it(bare: Tab) -> None:
    bare.after(lambda: bare.page.select_option("#preset", "paper"))
    assert bare.value("filter.logo_mode") == "stc_cut_trail"
    assert bare.page.locator(".control.differs").count() == 0
    bare.slide("logo.pad_px")
    assert bare.page.locator(".control.differs").count() == 1
    bare.after(lambda: bare.page.click("#undo"))
    bare.after(lambda: bare.page.click("#undo"))
    assert bare.page.input_value("#preset") == "opened"
    assert bare.page.locator(".control.differs").count() == 0


def test_a_file_named_like_a_preset_of_ours_does_not_take_its_place(bare: Tab, tmp_path: Path) -> None:
    (tmp_path / "paper.toml").write_text("[logo]\npad_px = 4.25\n", encoding="utf-8")
    paper = bare.page.evaluate("JSON.stringify(window.spinscope.opening.presets.paper)")
    bare.after(lambda: bare.page.set_input_files("#save input[type=file]", tmp_path / "paper.toml"))
    assert bare.value("logo.pad_px") == 4.25
    assert bare.page.input_value("#preset") == "paper.toml"
    assert bare.page.evaluate("JSON.stringify(window.spinscope.opening.presets.paper)") == paper
    bare.after(lambda: bare.page.select_option("#preset", "opened"))


def test_a_point_of_a_sweep_is_taken_by_a_click(bare: Tab) -> None:
    panel = bare.panel("Parameter sweep")
    panel.locator("input[aria-label=from]").fill("2")
    panel.locator("input[aria-label=to]").fill("5")
    panel.locator("input[aria-label=points]").fill("4")
    panel.locator("button.primary").click()
    bare.until("document.querySelectorAll('#side .chart .trace:first-child .point').length >= 4")
    panel.locator("progress").wait_for(state="hidden")
    titles = panel.locator(".chart:visible").evaluate_all("all => all.map((one) => one.getAttribute('aria-label'))")
    assert {"Spin", "Logo events", "Track jitter", "Error against truth"} <= set(titles)
    assert "logo.pad_px [px]" in panel.locator(".chart >> nth=0").text_content()
    chart = panel.locator(".chart[aria-label='Logo events']")
    point = chart.locator(".point").last

    with bare.page.expect_download() as saved:
        chart.locator(".modebar-btn").click(force=True)
    assert saved.value.suggested_filename == "logo_events.svg"
    assert Path(saved.value.path()).read_text(encoding="utf-8").startswith("<svg")

    def click() -> None:
        point.scroll_into_view_if_needed()
        box = point.bounding_box()
        bare.page.mouse.move(box["x"] + 1, box["y"] + 1)
        bare.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        chart.locator(".hovertext").first.wait_for(state="attached")
        bare.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    bare.after(click)
    assert bare.value("logo.pad_px") == 5
    bare.after(lambda: bare.page.click("#undo"))


def test_an_optimization_offers_better_values_alone_and_leads_back(bare: Tab) -> None:
    """The starting values are no proposal; better ones are what the server would tell."""
    panel = bare.panel("Optimization")
    panel.locator("input[aria-label=trials]").fill("1")
    before = bare.page.evaluate("JSON.stringify(window.spinscope.settings.parameters)")
    bare.page.evaluate("window.spinscope.connection.on('optimization', (message) => (window.found = message))")
    panel.locator("button.primary").first.click()
    panel.get_by_text("nothing better is found").wait_for()
    bare.until("window.found.state === 'done'")
    assert panel.locator("progress").is_hidden()
    take = panel.get_by_text("Apply the best values")
    assert take.count() == 0
    bare.page.evaluate(
        """(() => {
            const { content } = window.found, best = content.best / 2;
            const found = { ...content, best, values: { "logo.pad_px": 3.1 } };
            const message = { detail: { ...window.found, content: found } };
            window.spinscope.connection.dispatchEvent(new CustomEvent("optimization", message));
        })()"""
    )
    assert "No part was held out" in panel.locator(".found").inner_text()
    take.click()
    assert bare.value("logo.pad_px") == 3.1
    take.click()  # once more: that is no way back to where one is
    panel.locator("button.primary").first.click()
    panel.get_by_text("nothing better is found").wait_for()
    bare.until("window.found.state === 'done'")
    assert take.count() == 0
    back = panel.get_by_text("Restore the previous values")
    back.click()
    assert back.is_hidden()
    assert bare.page.evaluate("JSON.stringify(window.spinscope.settings.parameters)") == before


def test_a_frame_that_is_held_comes_later_or_is_cancelled_and_no_other_one_waits(bare: Tab) -> None:
    """By the number that was given out, however often the frame was put off."""
    came = bare.page.evaluate(
        """(async () => {
            const { HeldFrames } = await import("/static/held_frames.js");
            let isHeld = true;
            const frames = new HeldFrames(() => isHeld), came = [];
            const frame = () => new Promise(requestAnimationFrame);
            frames.cancelAnimationFrame(7); // there is none
            for (const name of ["early", "cancelled"]) {
                const number = frames.requestAnimationFrame(() => came.push(name));
                for (let i = 0; i < 3; i++) await frame();
                if (name === "cancelled") frames.cancelAnimationFrame(number);
            }
            came.push("held");
            isHeld = false;
            await new Promise((resolve) => frames.requestAnimationFrame(resolve));
            return came;
        })()"""
    )
    assert came == ["held", "early"]


def test_settings_are_found_by_words_and_what_differs_is_in_sight(browser: Any, tuner: Served) -> None:
    """Without the viewer: the essentials, the search, the list of what differs, an address that sets nonsense."""
    tab = bare_tab(browser, f"{tuner.address}#set=contrast.kernel_rad=0.05&set=__proto__.polluted=1")
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


def test_the_tools_of_a_page_can_be_turned_off(browser: Any, tuner: Served) -> None:
    tab = bare_tab(browser, f"{tuner.address}?tools=off#set=logo.pad_px=3.5")
    assert tab.page.locator("header").is_hidden() and tab.page.locator("#controls").is_hidden()
    assert tab.value("logo.pad_px") == 3.5
    tab.page.context.close()


def test_a_server_without_tools_gives_the_viewer_alone_on_the_chosen_tab(browser: Any, flight: Path) -> None:
    own = served(flight, tools=False, layout="tracker")
    try:
        tab = bare_tab(browser, own.address)
        for hidden in ("header", "#controls", "#side", "#bar", "#overview"):
            assert tab.page.locator(hidden).is_hidden(), hidden
        start = tab.page.evaluate("window.spinscope.runner.start")
        assert (start["tab"], start["hasTools"]) == ("Tracker", False)
        box = tab.page.locator("#viewer").bounding_box()
        assert (box["x"], box["y"], box["width"], box["height"]) == (0, 0, SIZE["width"], SIZE["height"])
        tab.page.context.close()
    finally:
        own.stop()


def test_two_tabs_and_a_reload(browser: Any, bare: Tab, tuner: Served) -> None:
    other = bare_tab(browser, tuner.address)
    mine = bare.value("logo.pad_px")
    other.slide("logo.pad_px", "PageUp")
    changed = other.value("logo.pad_px")
    assert changed > mine and bare.value("logo.pad_px") == mine
    other.page.wait_for_url(re.compile(r"set=logo\.pad_px"))
    other.page.reload()
    other.page.wait_for_selector("body[data-done]", state="attached")
    assert other.value("logo.pad_px") == changed
    other.page.goto("about:blank")
    other.open(f"{tuner.address}#set=logo.pad_px=-5&set=nothing.at=1&clip=7-3")
    other.settled()
    assert other.value("logo.pad_px") == mine  # a mangled link opens the recording all the same
    other.page.goto("about:blank")
    other.open(f"{tuner.address}#set=contrast.weakest=0.3&set=__proto__.weakest=1")
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
