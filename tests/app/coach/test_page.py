"""The coach's page in a real browser: list, shot, comparison, tests, live, by mouse, keyboard and touch."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn

from spinscope.app.coach.session import ShotSession
from spinscope.app.coach.session_folders import SAMPLE
from spinscope.app.web.coach_application import CoachState, coach_application
from spinscope.app.web.server import listening_socket

from .session_shots import KNOWN, analysis, shot

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
PATIENCE_MS = 120_000
SIZES = ((1280, 800), (820, 1180), (1180, 820), (1920, 1080), (390, 844))
PLACES = ("shots", "shot/29", "pair/4/19", "compare", "tests", "live")

needs_browser = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"there is no browser at {CHROMIUM}"),
]


@pytest.fixture
def session(tmp_path: Path) -> ShotSession:
    shutil.copytree(SAMPLE, tmp_path / "sample")
    return ShotSession(tmp_path / "sample")


@pytest.fixture
def address(session: ShotSession) -> Iterator[str]:
    """A server of the session's copy."""
    state = CoachState([session])
    listening = listening_socket(0)
    server = uvicorn.Server(uvicorn.Config(coach_application(state), log_level="error", timeout_graceful_shutdown=2))
    thread = threading.Thread(target=lambda: server.run([listening]), daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}/"
    state.close()
    server.should_exit = True
    thread.join(10)
    listening.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield made
        made.close()


class Tab:
    """A tab with the page in it, which fails when it loads from elsewhere or throws."""

    def __init__(self, browser: Any, address: str, **options: Any) -> None:
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, "locale": "en", **options})
        self.page = self.context.new_page()
        self.address = address
        self.errors: list[str] = []
        self.page.set_default_timeout(PATIENCE_MS)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda one: self.errors.extend([] if self._is_own(one.url) else [one.url]))
        self.page.on("console", lambda one: self.errors.extend([one.text] if one.type == "error" else []))
        self.go("shots")

    def _is_own(self, url: str) -> bool:
        return url.startswith((self.address, "data:", "blob:"))

    def go(self, place: str) -> None:
        self.page.goto(f"{self.address}#{place}")
        self.page.wait_for_selector("body[data-ready]", state="attached")
        self.until(f"document.body.dataset.place === {place!r}")

    def until(self, holds: str) -> None:
        """Wait until an expression holds in the page, whose policy forbids Playwright's own way."""
        end = time.monotonic() + PATIENCE_MS / 1000
        while not self.page.evaluate(holds):
            assert time.monotonic() < end, holds
            self.page.wait_for_timeout(30)

    def texts(self, selector: str) -> list[str]:
        return [str(text) for text in self.page.locator(selector).all_inner_texts()]

    def close(self) -> None:
        self.context.close()
        assert self.errors == []


@pytest.fixture
def tab(browser: Any, address: str) -> Iterator[Tab]:
    made = Tab(browser, address)
    yield made
    made.close()


class TestPage:
    pytestmark = needs_browser

    def test_the_list_filters_sorts_marks_names_deletes_and_undoes(self, tab: Tab, session: ShotSession) -> None:
        page, rows = tab.page, "table.shots tbody tr"
        assert page.locator(rows).count() == 24  # the rest as it is scrolled into view
        page.keyboard.press("End")
        tab.until(f"document.querySelectorAll('{rows}').length === 30")
        assert "46 rps right corkscrew and backspin, 21 km/h" in page.inner_text(".latest")
        page.get_by_role("button", name="Spin", exact=True).click()
        page.keyboard.press("End")
        tab.until(f"document.querySelectorAll('{rows}').length === 30")
        spins = [int(text.split()[0]) for text in tab.texts("td.spin")]
        assert spins == sorted(spins, reverse=True) and spins[0] == 87
        page.select_option("[name=filter-player]", "B")
        page.select_option("[name=filter-drill]", "serves")
        assert page.locator(rows).count() == 2  # serves of B
        page.locator(f"{rows} input").first.check()
        page.fill("form.names [name=stroke]", "long serve")
        page.get_by_role("button", name="Apply").click()
        page.wait_for_selector("td.player:has-text('long serve')")
        page.locator(f"{rows} .star").first.click()
        page.wait_for_selector(".star[aria-pressed=true]")
        page.locator(f"{rows} input").first.check()
        page.get_by_role("button", name="Delete").click()
        tab.until(f"document.querySelectorAll('{rows}').length === 1")
        (row,) = [row for row in session.shots() if row["deleted"]]
        assert (row["stroke"], row["marked"], row["player"]) == ("long serve", 1, "B")
        for _ in range(3):
            page.keyboard.press("Control+z")
        tab.until(f"document.querySelectorAll('{rows}').length === 2")
        tab.until(f"window.coach.shots.get({row['id']}).stroke === 'serve'")
        again = next(one for one in session.shots() if one["id"] == row["id"])
        assert (again["stroke"], again["marked"], again["deleted"]) == ("serve", 0, 0)

    def test_a_shot_plays_steps_and_is_left_by_keys(self, tab: Tab) -> None:
        page, ink = tab.page, "document.querySelector('canvas.ball').toDataURL()"
        tab.go("shot/28")
        assert "Right sidespin" in page.inner_text(".facts .kind")
        assert "Before the bounce" in page.inner_text(".shot")
        tab.until("window.coach.view.player.motion.isPlaying")
        page.evaluate(f"window.inkBefore = {ink}")
        tab.until(f"{ink} !== window.inkBefore")
        page.keyboard.press(" ")
        tab.until("!window.coach.view.player.motion.isPlaying")
        before = page.evaluate("window.coach.view.player.motion.t_us")
        page.keyboard.press(".")
        step_us = page.evaluate("window.coach.view.player.motion.t_us") - before
        assert step_us == pytest.approx(1e6 / 24 / 44.6, rel=0.05)  # a 24th of a turn
        page.keyboard.press("ArrowRight")
        tab.until("document.body.dataset.place === 'shot/29'")
        page.keyboard.press("m")
        page.wait_for_selector(".shot .star[aria-pressed=true]")
        page.keyboard.press("Escape")
        page.wait_for_selector("table.shots")

    def test_the_painted_ball_is_that_of_the_report(self, tab: Tab, session: ShotSession) -> None:
        """The logo's ink in the page lies where the picture painted without a screen has it."""
        import cv2
        import numpy as np

        from spinscope.app.coach.ball_picture import ball_picture

        tab.go("shot/28")
        tab.until("window.coach.view.player.motion.isPlaying")
        for share in (0.2, 0.5, 0.8):
            row = session.shot(28)
            t_us = row["start_us"] + share * (row["end_us"] - row["start_us"])
            tab.page.evaluate(f"window.coach.view.player.pause(); window.coach.view.player.motion.seek({t_us})")
            shown = cv2.imdecode(
                np.frombuffer(tab.page.locator("canvas.ball").screenshot(), np.uint8), cv2.IMREAD_COLOR
            )
            painted = ball_picture(row["detail"], 200, t_us)
            assert painted is not None
            small = cv2.resize(shown[..., ::-1], (200, 200), interpolation=cv2.INTER_AREA)
            ink = [picture[..., 2].astype(int) - picture[..., 0] > 30 for picture in (small, painted)]
            assert ink[1].sum() > 100 and (ink[0] & ink[1]).sum() > 0.7 * ink[1].sum()

    def test_language_and_units_are_remembered_and_terms_explained(self, tab: Tab) -> None:
        page = tab.page
        page.select_option("select[name=language]", "de")
        page.select_option("select[name=spin]", "rpm")
        page.select_option("select[name=speed]", "m_s")
        tab.go("shot/1")
        tab.page.reload()
        tab.go("shot/1")
        assert page.inner_text(".number") == "3.989 U/min" and "14,0 m/s" in page.inner_text(".numbers")
        page.locator("dl.numbers .term").first.focus()
        assert "Mittleres Tempo" in page.locator("dl.numbers .about").first.inner_text()

    def test_the_comparison_answers(self, tab: Tab) -> None:
        tab.go("compare")
        tab.page.wait_for_selector(".answers li")
        answers = tab.texts(".answers li")
        assert answers[0] == "A has the most topspin: 74 rps in the middle."
        assert "A: the spin rose by" in answers[1] and answers[2] == "B: no clear change."
        assert tab.page.locator("svg.chart polygon").count() == 2
        tab.page.locator("svg.chart .mark").first.click()
        tab.page.wait_for_selector("section.shot")

    def test_a_test_counts_and_compares_with_the_last_time(self, tab: Tab, session: ShotSession) -> None:
        tab.go("tests")
        tab.page.wait_for_selector(".protocols .card table")
        assert any("maximum topspin" in text and "+9 rps" in text for text in tab.texts(".protocols .card"))
        tab.page.get_by_role("button", name="maximum topspin").click()
        tab.page.fill(".start [name=player]", "A")
        tab.page.locator(".start form button").click()
        tab.page.wait_for_selector(".start:has-text('0 of 10 balls')")
        assert session.setting("now") == {"player": "A", "drill": "maximum topspin"}

    def test_a_year_of_tests_is_shown(self, tab: Tab, session: ShotSession) -> None:
        days = [shot(1, recorded_s=1.7e9 + 86_400 * day) for day in range(150)]
        ids = [session.add(f"{day}.raw", KNOWN, analysis(one))[0] for day, one in enumerate(days)]
        session.name_shots(ids, {"player": "C", "drill": "serves"})
        tab.go("tests")
        tab.until("document.querySelectorAll('.protocols tbody tr').length >= 150")

    def test_a_shot_that_comes_in_leaves_what_is_being_filled_in(self, tab: Tab, session: ShotSession) -> None:
        tab.go("tests")
        tab.page.get_by_role("button", name="serves").click()
        tab.page.fill(".start [name=player]", "B")
        tab.page.get_by_role("button", name="serves").focus()
        (new,) = session.add("new.raw", KNOWN, analysis(shot(1, recorded_s=1.8e9, spin_rps=91.4, topspin_rps=91.4)))
        tab.until(f"window.coach.shots.get({new}) !== null")
        tab.page.keyboard.press("Shift+Tab")
        assert tab.page.input_value(".start [name=player]") == "B"
        tab.page.locator(".start [name=player]").press("Enter")
        tab.page.wait_for_selector(".start:has-text('0 of 10 balls')")
        assert session.setting("now") == {"player": "B", "drill": "serves"}

    def test_a_new_shot_appears_by_itself(self, tab: Tab, session: ShotSession) -> None:
        tab.go("live")
        tab.page.evaluate("void (window.speechSynthesis.speak = (said) => window.said = said.text)")
        tab.page.get_by_label("Speak the numbers").check()
        session.add("new.raw", KNOWN, analysis(shot(1, recorded_s=1.8e9, spin_rps=91.4, topspin_rps=91.4)))
        tab.page.wait_for_selector(".live .value:has-text('91')")
        assert tab.page.evaluate("window.said") == "topspin, 91 rps, 36 km/h"

    def test_what_is_not_seen_is_said(self, tab: Tab, session: ShotSession) -> None:
        unknown = dict.fromkeys(("spin_rps", "spin_std_rps", "topspin_rps", "sidespin_rps", "corkscrew_rps"))
        detail = '{"path": {"t_us": [], "x_m": [], "y_m": [], "z_m": []}, "hitter": null, "spin_rps": null,'
        detail += '"depth_std_m": 0, "line_of_sight": [0, 0, 1],'
        detail += '"reference_us": 0, "texture": null, "proof": null}'
        refused = shot(1, recorded_s=1.8e9, **unknown, method=None, told_by=None, reason="too dark", detail=detail)
        (new,) = session.add("new.raw", KNOWN, analysis(refused))
        tab.page.wait_for_selector("td.kind:has-text('too dark')")
        assert "not seen" in tab.page.inner_text(".latest")
        tab.go(f"shot/{new}")
        assert "too dark" in tab.page.inner_text(".stage") and tab.page.locator("canvas.ball").count() == 0

    def test_nothing_sticks_out_at_any_size(self, browser: Any, address: str) -> None:
        tab = Tab(browser, address, locale="de", has_touch=True)
        for place in PLACES:
            tab.go(place)
            for width, height in SIZES:
                tab.page.set_viewport_size({"width": width, "height": height})
                tab.until(f"window.innerWidth === {width}")
                wide = tab.page.evaluate("document.documentElement.scrollWidth")
                assert wide <= width, f"{place} at {width} x {height}: {wide} px"
        tab.close()

    def test_a_swipe_leads_to_the_next_shot(self, browser: Any, address: str) -> None:
        tab = Tab(browser, address, viewport={"width": 820, "height": 1180}, has_touch=True)
        tab.go("shot/3")
        tab.page.evaluate(
            """const root = document.querySelector("section.shot .headline");
            const touch = (x) => [new Touch({ identifier: 1, target: root, clientX: x, clientY: 500 })];
            root.dispatchEvent(new TouchEvent("touchstart", { touches: touch(600), bubbles: true }));
            root.dispatchEvent(new TouchEvent("touchend", { changedTouches: touch(300), bubbles: true }));"""
        )
        tab.until("location.hash === '#shot/4'")
        tab.close()

    def test_every_control_has_a_name(self, tab: Tab) -> None:
        for place in PLACES:
            tab.go(place)
            nameless = tab.page.evaluate(
                """[...document.querySelectorAll("button, a, select, input, canvas, svg[role=img]")].filter((one) =>
                !(one.textContent.trim() || one.getAttribute("aria-label") || one.labels?.length || one.title))
                .map((one) => one.outerHTML)"""
            )
            assert nameless == [], place


def test_requests_from_elsewhere_and_nonsense_are_refused(address: str) -> None:
    post = f"{address}api/coach/sample/names"
    good = {"ids": [1], "values": {"player": "C"}}
    assert httpx.post(post, json=good, headers={"origin": "http://evil.example"}).status_code == 403
    assert httpx.post(post, content=b"{}").status_code == 415
    assert httpx.post(post, json={"ids": [1], "values": {"spin_rps": "90"}}).status_code == 400
    assert httpx.post(post, json={**good, "more": 1}).status_code == 422
    assert httpx.get(f"{address}api/coach/other/shots").status_code == 404
    assert httpx.get(f"{address}api/coach/sample/shots/999").status_code == 400
    assert httpx.get(f"{address}api/coach/sample/report.html?language=xx").status_code == 422
    assert httpx.post(post, json=good).json()["revision"] > 0
    found = httpx.get(f"{address}api/coach/sample/shots").json()["shots"]
    assert [one["player"] for one in found if one["id"] == 1] == ["C"]
    pictures = httpx.get(f"{address}api/coach/sample/pictures/1")
    assert pictures.content.startswith(b"\x89PNG")
