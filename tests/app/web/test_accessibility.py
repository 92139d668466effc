"""The page by keyboard alone, and what axe-core finds in it; without the viewer, whose part is in test_browser.py."""

from __future__ import annotations

import pytest

from .browser_tab import Tab, needs_browser, serious

pytestmark = needs_browser
FOCUSED = "document.activeElement.id || document.activeElement.textContent"


def test_a_list_of_all_keys_opens_and_closes(bare: Tab) -> None:
    page = bare.page
    page.keyboard.press("?")
    text = page.locator("#keys").inner_text()
    for word in ("Space", "Home", "Tab Compare", "Undo", "Full screen", "Save"):
        assert word in text
    page.keyboard.press("Escape")
    assert page.locator("#keys").is_hidden()


def test_a_section_is_explained_by_the_glossary(bare: Tab) -> None:
    page = bare.page
    details = page.locator("#controls details[data-title='Surface (EROS)']")
    details.locator("> summary").click()
    details.locator("> .help").click()
    text = page.locator("dialog.glossary").inner_text()
    assert "Exponential reduced ordinal surface (Gava et al., 2022): an image" in text and "{term}" not in text
    assert serious(page) == []
    page.keyboard.press("Escape")
    assert page.locator("dialog.glossary").count() == 0
    details.locator("> summary").click()


def test_the_first_tab_stops_lead_past_all_controls(bare: Tab) -> None:
    page = bare.page
    page.evaluate("document.activeElement.blur()")
    for target, found in (("controls", "search"), ("middle", "#overview svg"), ("side", "Result")):
        skip = page.locator(f".skip[data-target={target}]")
        skip.focus()
        assert skip.bounding_box()["y"] >= 0  # it is seen while it has the focus
        page.keyboard.press("Enter")
        if target == "middle":
            assert page.evaluate(f"document.activeElement === document.querySelector('{found}')")
        else:
            assert page.evaluate(FOCUSED) == found


def test_letters_act_but_not_while_typing(bare: Tab) -> None:
    page = bare.page
    page.evaluate("document.activeElement.blur()")
    bare.after(lambda: page.keyboard.press("a"))
    assert page.locator("#discard").is_visible()
    bare.after(lambda: page.keyboard.press("z"))
    assert page.locator("#discard").is_hidden()
    page.keyboard.press("/")
    page.keyboard.type("za")
    assert page.input_value("#search") == "za" and page.locator("#discard").is_hidden()
    page.fill("#search", "")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("s")
    assert page.locator("#save .items").is_visible()
    page.keyboard.press("Escape")
    assert page.locator("#save .items").is_hidden()


def test_arrows_belong_to_a_slider_that_has_the_focus(bare: Tab) -> None:
    before = bare.value("logo.pad_px")
    bare.slide("logo.pad_px", "ArrowRight")
    assert bare.value("logo.pad_px") > before
    bare.after(lambda: bare.page.keyboard.press("z"))
    assert bare.value("logo.pad_px") == before


@pytest.mark.parametrize("opened", ["#side details", "#controls details, #save", "#keys"])
def test_axe_finds_nothing_serious(bare: Tab, opened: str) -> None:
    page = bare.page
    page.evaluate(f"for (const one of document.querySelectorAll('{opened}')) one.showModal?.() ?? (one.open = true)")
    assert serious(page) == []
    page.evaluate(f"for (const one of document.querySelectorAll('{opened}')) one.close?.() ?? (one.open = false)")
