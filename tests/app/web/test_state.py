"""What the address and the page remember: links, back and forward, another recording, notices; without the viewer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from .browser_tab import SIZE, Tab, bare_tab, needs_browser
from .conftest import Served

pytestmark = needs_browser


@pytest.fixture
def bare(browser: Any, tuner: Served) -> Iterator[Tab]:
    """The page without the viewer's picture."""
    made = bare_tab(browser, f"{tuner.address}#set=logo.pad_px=3")
    yield made
    made.page.context.close()


def test_a_pasted_link_and_the_way_back_and_forward_change_the_open_page(bare: Tab) -> None:
    page = bare.page
    page.evaluate("window.isSamePage = true")
    page.wait_for_url(re.compile("recording="))
    bare.after(lambda: page.evaluate("location.hash = 'set=logo.pad_px=4&pinned=1&preset=paper'"))
    assert bare.value("logo.pad_px") == 4
    assert page.locator("#discard").is_visible() and page.input_value("#preset") == "paper"
    page.wait_for_url(re.compile("recording="))
    bare.slide("logo.pad_px")
    changed = bare.value("logo.pad_px")
    page.wait_for_url(re.compile(f"pad_px%3D{changed}"))
    for go, value in ((page.go_back, 4), (page.go_back, 3), (page.go_forward, 4), (page.go_forward, changed)):
        bare.after(go)
        assert bare.value("logo.pad_px") == value
    assert page.evaluate("window.isSamePage")
    page.reload()
    page.wait_for_selector("body[data-done]", state="attached")
    assert bare.value("logo.pad_px") == changed
    assert page.locator("#discard").is_visible() and page.input_value("#preset") == "paper"


def test_settings_go_along_to_another_recording_when_wanted_and_the_set_up_stays(bare: Tab) -> None:
    page = bare.page
    bare.after(lambda: page.evaluate("window.spinscope.settings.set('camera.focal_length_mm', 16)"))
    others = ("spinner_ball1_top.h5", "spinner_ball2_side.h5")
    for name in others:
        page.evaluate("delete document.body.dataset.done")
        page.keyboard.press("o")
        page.get_by_role("button", name=name).click()
        if name == others[0]:
            assert "logo.pad_px=3" in page.inner_text("dialog.ask") and "focal" not in page.inner_text("dialog.ask")
            page.get_by_text("Take them along").click()
        page.wait_for_url(re.compile(f"recording={name}"))
        bare.until(f"window.spinscope?.connection?.recording === '{name}' && document.body.dataset.done !== undefined")
        assert bare.value("logo.pad_px") == 3
        assert bare.value("camera.focal_length_mm") != 16


def test_without_the_viewer_a_preview_follows_the_playhead(bare: Tab) -> None:
    page = bare.page
    page.locator("#preview img").wait_for()
    assert "rps so far" in page.inner_text("#preview figcaption")
    page.focus("#overview svg")
    page.keyboard.press("End")
    end_ms, tick_ms = page.evaluate("window.spinscope.settings.clip[1]") / 1000, bare.value("track.tick_us") / 1000
    shown_ms = "parseFloat(document.querySelector('#preview figcaption').textContent.split(', at ')[1])"
    bare.until(f"{shown_ms} > {end_ms - tick_ms}")
    page.keyboard.press("ArrowLeft")
    bare.until(f"{shown_ms} <= {end_ms - tick_ms}")
    there_us = page.evaluate("window.spinscope.viewer.playhead_us")
    page.wait_for_url(re.compile(f"t={there_us}"))
    page.keyboard.press("2")  # a tab that the viewer is to show when it comes
    page.wait_for_url(re.compile("tab=Tracker"))
    page.keyboard.press("1")
    page.wait_for_url(re.compile("^((?!tab=Tracker).)*$"))
    page.reload()
    page.wait_for_selector("body[data-done]", state="attached")
    bare.until(f"{shown_ms} > {end_ms - 3 * tick_ms} && {shown_ms} <= {end_ms - tick_ms}")
    assert page.get_attribute("#overview svg", "aria-valuenow") == str(there_us)


def test_without_the_viewer_a_video_shows_the_previews(bare: Tab) -> None:
    made = bare.page.evaluate(
        """import("/static/video.js").then(async ({ filmed }) => {
            const part = { settings: { clip: [50000, 52000] }, overview: { shots: [] } };
            const video = await filmed({ ...window.spinscope, ...part });
            return [video.type, video.size];
        })"""
    )
    assert made[0] == "video/mp4" and made[1] > 1000
    assert bare.page.locator("dialog.ask").count() == 0


def test_notices_stay_until_read_and_can_be_looked_up(bare: Tab) -> None:
    page = bare.page
    bare.until("window.spinscope.runner.isBlind")  # of which there is a notice
    for notice in page.locator(".notice").all():
        notice.click()
    box = page.locator("[data-name='logo.pad_px'] input.number")
    for text in ("900", "-1"):
        box.fill(text)
        box.press("Enter")
    page.wait_for_timeout(200)
    assert page.locator(".notice").count() == 2
    page.keyboard.press("Escape")  # closes the newest
    assert page.locator(".notice").count() == 1 and "900" in page.inner_text(".notice")
    assert "new" in page.inner_text("#all-notices")
    page.click("#all-notices")
    assert page.locator(".notice").count() == 0
    rows = page.locator("#notices-list tr").all_inner_texts()
    assert "-1" in rows[0] and "900" in rows[1]
    page.keyboard.press("Escape")
    assert page.inner_text("#all-notices") == "Notices"


def test_a_layout_that_the_viewer_does_not_take_is_said_until_it_is_taken(browser: Any, tuner: Served) -> None:
    """By a viewer that takes everything else at once, and its layout with the second picture."""
    context = browser.new_context(viewport=SIZE)
    tab = Tab(context.new_page())
    tab.page.add_init_script(
        """let app;
        window.takesLayout = false;
        Object.defineProperty(window, "spinscope", {
            get: () => app,
            set: (made) => {
                app = made;
                for (const name of ["start", "layout"]) made.viewer[name] = async () => {};
                made.viewer.show = async () => true;
                made.viewer.laidOut = async () => window.takesLayout;
            },
        });"""
    )
    tab.open(tuner.address)
    tab.settled("shown")
    said = tab.page.locator(".notice.warning", has_text="layout")
    assert said.count() == 1
    assert "reload the page" in said.inner_text()
    tab.page.evaluate("window.takesLayout = true")
    tab.slide("logo.pad_px", what="shown")
    assert said.count() == 0
    context.close()
