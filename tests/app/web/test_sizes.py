"""The page on screens of several sizes: nothing is cut, panels fold and stay so; without the viewer."""

from __future__ import annotations

import pytest

from .browser_tab import Tab, needs_browser

pytestmark = needs_browser
# Of laptops, of screens on desks, of one at a zoom of 150 %, of a tablet upright.
SIZES = [(1280, 800), (1366, 768), (1920, 1080), (2560, 1440), (911, 512), (820, 1180)]


@pytest.mark.parametrize("size", SIZES)
def test_all_of_the_page_is_inside_the_window(bare: Tab, size: tuple[int, int]) -> None:
    width, height = size
    bare.page.set_viewport_size({"width": width, "height": height})
    for part in ("header", "header > *:visible", "#controls", "#middle", "#viewer", "#bar", "#side"):
        for found in bare.page.locator(part).all():
            box = found.bounding_box()
            assert box is not None and box["x"] >= 0 and box["y"] >= 0, part
            assert box["x"] + box["width"] <= width + 1 and box["y"] + box["height"] <= height + 1, part
    viewer = bare.page.locator("#viewer").bounding_box()
    assert viewer["width"] >= min(0.63 * width, 1200) and viewer["height"] >= 0.45 * height
    bare.page.evaluate("import('/static/elements.js').then(({ notice }) => notice('one that is to be read'))")
    note, bar = bare.page.locator("#notices").bounding_box(), bare.page.locator("#bar").bounding_box()
    assert note["y"] + note["height"] <= bar["y"] or note["y"] >= bar["y"] + bar["height"]
    overflow = "(one) => one.scrollWidth - one.clientWidth"
    assert bare.page.locator("#controls").evaluate(overflow) <= 0 and bare.page.locator("#side").evaluate(overflow) <= 0


@pytest.mark.parametrize("width", [1280, 1366, 1920])
def test_the_header_keeps_to_one_line_with_a_pinned(bare: Tab, width: int) -> None:
    bare.page.set_viewport_size({"width": width, "height": 800})
    bare.page.evaluate("import('/static/elements.js').then(({ notice }) => notice('one that is to be read'))")
    bare.page.get_by_text("Notices: ").wait_for()
    if bare.page.locator("#swap").is_hidden():
        bare.after(lambda: bare.page.click("#pin"))
    heights = {one.bounding_box()["y"] // 20 for one in bare.page.locator("header button:visible").all()}
    assert bare.page.locator("#swap").is_visible() and len(heights) == 1


def test_folded_panels_make_room_and_stay_folded(bare: Tab) -> None:
    page = bare.page
    page.set_viewport_size({"width": 1280, "height": 800})
    for key, panel in (("[", "#controls"), ("]", "#side")):
        page.keyboard.press(key)
        assert page.locator(panel).is_hidden()
    assert page.locator("#viewer").bounding_box()["width"] == 1280
    page.reload()
    page.wait_for_selector("body[data-done]", state="attached")
    assert page.locator("#controls").is_hidden() and page.locator("#side").is_hidden()
    page.click("#fold-controls")
    page.click("#fold-side")
    assert page.locator("#controls").is_visible() and page.locator("#side").is_visible()
    assert page.locator("#fold-side").get_attribute("aria-pressed") == "true"


def test_long_lists_open_at_their_beginning_at_a_zoom_of_150_percent(bare: Tab) -> None:
    """Their only button is at the end; Escape closes them."""
    page = bare.page
    page.set_viewport_size({"width": 911, "height": 512})
    page.evaluate(
        """(() => {
            const detail = { text: "one of many", kind: "info" };
            for (let i = 0; i < 30; i++) document.dispatchEvent(new CustomEvent("notice", { detail }));
        })()"""
    )
    for opens in ("#help", "#all-notices", "[data-title=Essentials] > button.help"):
        page.locator(opens).first.click()
        dialog = page.locator("dialog[open]")
        assert dialog.evaluate("(one) => one.scrollHeight > one.clientHeight"), opens
        title, box = dialog.locator("h2").bounding_box(), dialog.bounding_box()
        assert title["y"] >= box["y"], opens
        page.keyboard.press("Escape")
        assert page.locator("dialog[open]").count() == 0


def test_the_circle_of_a_fixed_ball_is_read_whole(bare: Tab) -> None:
    panel = bare.panel("Fixed ball")
    for size in SIZES:
        bare.page.set_viewport_size({"width": size[0], "height": size[1]})
        for box in panel.locator("input.number").all():
            box.fill("427.68")
            assert box.evaluate("(one) => one.scrollWidth <= one.clientWidth"), size
