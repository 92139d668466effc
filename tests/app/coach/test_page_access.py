"""The coach's page for everybody: at all sizes, by touch, by keyboard alone, and what axe-core finds in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

from spinscope.app.coach.session import ShotSession

from .coach_tab import PLACES, CoachTab, needs_browser
from .marked_table import write_table_recording
from .session_shots import KNOWN

pytestmark = needs_browser
SIZES = ((1280, 800), (820, 1180), (1180, 820), (1920, 1080), (390, 844))
TABLET = {"viewport": {"width": 820, "height": 1180}, "has_touch": True}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}


def test_nothing_sticks_out_at_any_size(browser: Any, address: str) -> None:
    tab = CoachTab(browser, address, locale="de", has_touch=True)
    for place in PLACES:
        tab.go(place)
        for width, height in SIZES:
            tab.page.set_viewport_size({"width": width, "height": height})
            tab.until(f"window.innerWidth === {width}")
            wide = tab.page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, f"{place} at {width} x {height}: {wide} px"
    tab.close()


def test_a_swipe_leads_to_the_next_shot(browser: Any, address: str) -> None:
    tab = CoachTab(browser, address, **TABLET)
    tab.go("shot/3")
    tab.page.evaluate(
        """const root = document.querySelector("section.shot .headline");
        const touch = (x) => [new Touch({ identifier: 1, target: root, clientX: x, clientY: 500 })];
        root.dispatchEvent(new TouchEvent("touchstart", { touches: touch(600), bubbles: true }));
        root.dispatchEvent(new TouchEvent("touchend", { changedTouches: touch(300), bubbles: true }));"""
    )
    tab.until("location.hash === '#shot/4'")
    tab.close()


@pytest.mark.parametrize(("language", "options"), [("en", {}), ("de", PHONE)])
def test_axe_finds_nothing_serious(
    browser: Any, address: str, session: ShotSession, tmp_path: Path, language: str, options: dict[str, Any]
) -> None:
    write_table_recording(tmp_path / "table.h5")
    session.add(str(tmp_path / "table.h5"), KNOWN, None)
    tab = CoachTab(browser, address, locale=language, **options)
    for place in (*PLACES, "table"):
        tab.go(place)
        violations = Axe().run(tab.page).response["violations"]
        serious = [
            (one["id"], node["html"][:200])
            for one in violations
            if one["impact"] in ("serious", "critical")
            for node in one["nodes"]
        ]
        assert serious == [], place
    tab.close()


def test_all_is_reached_by_touch(browser: Any, address: str, session: ShotSession) -> None:
    tab = CoachTab(browser, address, **TABLET)
    page = tab.page
    page.locator("table.shots td.time a").first.tap()
    page.wait_for_selector("section.shot")
    tab.until("window.coach.view.player.motion.isPlaying")
    page.locator(".player .play").tap()
    tab.until("!window.coach.view.player.motion.isPlaying")
    page.locator("dl.numbers .term").first.tap()
    page.wait_for_selector("dl.numbers .about:visible")
    page.get_by_role("button", name="Mark", exact=False).last.tap()
    page.wait_for_selector(".star[aria-pressed=true]")
    assert sum(row["marked"] for row in session.shots()) == 1
    page.get_by_role("button", name="Previous shot").tap()
    tab.until("document.body.dataset.place === 'shot/29'")
    for place in ("compare", "tests", "live", "shots"):
        page.locator(f"header nav a[href='#{place}']").tap()
        tab.until(f"document.body.dataset.place === '{place}'")
    tab.close()


def test_all_is_reached_by_keyboard(tab: CoachTab, session: ShotSession) -> None:
    page = tab.page

    def tab_to(selector: str) -> None:
        for _ in range(150):
            page.keyboard.press("Tab")
            if page.evaluate(f"document.activeElement.matches({selector!r})"):
                return
        raise AssertionError(f"{selector} is not reached")

    tab_to("td input[type=checkbox]")
    page.keyboard.press("Space")
    page.wait_for_selector("form.names")
    tab_to("td.picture a")
    page.keyboard.press("Enter")
    page.wait_for_selector("section.shot")
    tab.until("window.coach.view.player.motion.isPlaying")
    tab_to(".player .play")
    page.keyboard.press("Enter")
    tab.until("!window.coach.view.player.motion.isPlaying")
    tab_to(".bars .term")
    page.wait_for_selector(".bars .about:visible")
    tab_to(".star")
    page.keyboard.press("Enter")
    page.wait_for_selector(".star[aria-pressed=true]")
    assert sum(row["marked"] for row in session.shots()) == 1
