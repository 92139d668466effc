"""The coach's page in a real browser: list, shot, comparison, tests, live, table."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from spinscope.app.coach.session import ShotSession

from .coach_tab import CoachTab, needs_browser
from .marked_table import MIDDLE_M, SIZE_PX, TURN, corners_px, write_table_recording
from .session_shots import KNOWN, NO_DETAIL, analysis, shot


class TestPage:
    pytestmark = needs_browser

    def test_the_list_filters_sorts_marks_names_deletes_and_undoes(self, tab: CoachTab, session: ShotSession) -> None:
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

    def test_a_shot_plays_steps_and_is_left_by_keys(self, tab: CoachTab) -> None:
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

    def test_the_painted_ball_is_that_of_the_report(self, tab: CoachTab, session: ShotSession) -> None:
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

    def test_the_tables_corners_are_marked_by_clicks_and_arrow_keys(
        self, tab: CoachTab, session: ShotSession, tmp_path: Path
    ) -> None:
        page = tab.page
        write_table_recording(tmp_path / "table.h5")
        session.keep_setting("pose", None)
        session.add(str(tmp_path / "table.h5"), KNOWN, None)
        tab.go("shot/2")
        assert "flight without the table" in page.inner_text(".flight")
        page.get_by_role("link", name="Mark the table").click()
        page.wait_for_selector(".marks .corner")
        picture = page.locator(".marks .picture svg")
        box = picture.bounding_box()
        assert box is not None
        scale = box["width"] / SIZE_PX[0]
        for x, y in corners_px():
            picture.click(position={"x": scale * (x + 0.5), "y": scale * (y + 0.5)})
        page.locator(".marks .corner").first.focus()
        for key in ("Shift+ArrowRight", "Shift+ArrowLeft"):
            page.keyboard.press(key)
        page.get_by_role("button", name="Keep the corners").click()
        page.wait_for_selector(".notice:has-text('above the table')")
        tab.until("document.body.dataset.place === 'shots'")
        height_m = session.setting("pose")["camera_m"][2]
        assert height_m == pytest.approx(abs(MIDDLE_M @ TURN[:, 2]), rel=0.01)
        tab.go("shot/2")
        assert page.locator(".flight rect.table").count() == 2

    def test_language_and_units_are_remembered_and_terms_explained(self, tab: CoachTab) -> None:
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

    def test_the_comparison_answers(self, tab: CoachTab) -> None:
        tab.go("compare")
        tab.page.wait_for_selector(".answers li")
        answers = tab.texts(".answers li")
        assert answers[0] == "A has the most topspin: 74 rps in the middle."
        assert "A: the spin rose by" in answers[1] and answers[2] == "B: no clear change (second half against first)."
        assert tab.page.locator("svg.chart polygon").count() == 2
        tab.page.locator("svg.chart .mark").first.click()
        tab.page.wait_for_selector("section.shot")

    def test_sessions_are_compared_and_before_and_after_a_day(self, tab: CoachTab, earlier: ShotSession) -> None:
        page = tab.page
        tab.go("compare")
        page.wait_for_selector(".answers li")
        count = page.locator("svg.chart .mark").count()
        page.get_by_label("All sessions").check()
        tab.until(f"document.querySelectorAll('svg.chart .mark').length > {count}")
        page.select_option("[name=since]", index=1)
        page.wait_for_selector(".answers li:has-text('A: the spin rose by 4')")
        page.select_option("[name=by]", "session")
        page.wait_for_selector("table.statistics th:has-text('earlier')")
        page.locator("table.statistics tr:has-text('earlier') button").click()
        page.wait_for_selector("section.shot .number:has-text('33')")
        assert page.input_value("select[name=session]") == "earlier"

    def test_a_test_counts_and_compares_with_the_last_time(self, tab: CoachTab, session: ShotSession) -> None:
        tab.go("tests")
        tab.page.wait_for_selector(".protocols .card table")
        assert any("maximum topspin" in text and "+9 rps" in text for text in tab.texts(".protocols .card"))
        tab.page.get_by_role("button", name="maximum topspin").click()
        tab.page.fill(".start [name=player]", "A")
        tab.page.locator(".start form button").click()
        tab.page.wait_for_selector(".start:has-text('0 of 10 balls')")
        assert session.setting("now") == {"player": "A", "drill": "maximum topspin"}

    def test_a_year_of_tests_is_shown(self, tab: CoachTab, session: ShotSession) -> None:
        days = [shot(1, recorded_s=1.7e9 + 86_400 * day) for day in range(150)]
        ids = [session.add(f"{day}.raw", KNOWN, analysis(one))[0] for day, one in enumerate(days)]
        session.name_shots(ids, {"player": "C", "drill": "serves"})
        tab.go("tests")
        tab.until("document.querySelectorAll('.protocols tbody tr').length >= 150")

    def test_a_late_answer_does_not_replace_a_newer_one(self, tab: CoachTab, session: ShotSession) -> None:
        """The first statistics come after everything that is asked for later."""
        tab.page.evaluate(
            """() => {
                const own = window.fetch;
                let asked = 0;
                window.fetch = async (path, ...rest) => {
                    const isFirst = path === "/api/coach/statistics" && ++asked === 1;
                    if (isFirst) await new Promise((go) => setTimeout(go, 1500));
                    return own(path, ...rest);
                };
            }"""
        )
        tab.page.evaluate("() => { location.hash = 'tests'; }")
        days = [shot(1, recorded_s=1.7e9 + 86_400 * day) for day in range(30)]
        ids = [session.add(f"{day}.raw", KNOWN, analysis(one))[0] for day, one in enumerate(days)]
        session.name_shots(ids, {"player": "C", "drill": "serves"})
        tab.until(f"window.coach.shots.get({ids[-1]})?.drill === 'serves'")
        tab.page.wait_for_timeout(2500)
        tab.until("document.querySelectorAll('.protocols tbody tr').length >= 30")

    def test_a_shot_that_comes_in_leaves_what_is_being_filled_in(self, tab: CoachTab, session: ShotSession) -> None:
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

    def test_a_new_shot_appears_by_itself(self, tab: CoachTab, session: ShotSession) -> None:
        tab.go("live")
        tab.page.evaluate("void (window.speechSynthesis.speak = (said) => window.said = said.text)")
        tab.page.get_by_label("Speak the numbers").check()
        session.add("new.raw", KNOWN, analysis(shot(1, recorded_s=1.8e9, spin_rps=91.4, topspin_rps=91.4)))
        tab.page.wait_for_selector(".live .value:has-text('91')")
        assert tab.page.evaluate("window.said") == "topspin, 91 rps, 36 km/h"

    def test_what_is_not_seen_is_said(self, tab: CoachTab, session: ShotSession) -> None:
        unknown = dict.fromkeys(("spin_rps", "spin_std_rps", "topspin_rps", "sidespin_rps", "corkscrew_rps"))
        refused = shot(1, recorded_s=1.8e9, **unknown, method=None, told_by=None, reason="too dark", detail=NO_DETAIL)
        (new,) = session.add("new.raw", KNOWN, analysis(refused))
        tab.page.wait_for_selector("td.kind:has-text('too dark')")
        assert "not seen" in tab.page.inner_text(".latest")
        tab.go(f"shot/{new}")
        assert "too dark" in tab.page.inner_text(".stage") and tab.page.locator("canvas.ball").count() == 0


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
    landings = httpx.get(f"{address}api/coach/sample/landings").json()["landings"]
    bounced = [one["id"] for one in found if one["ended_by"] == "bounce"]
    assert len(bounced) == 1 and [int(one) for one in landings] == bounced and abs(landings[str(bounced[0])][0]) < 1.37
    assert httpx.get(f"{address}api/coach/sample/shots.parquet").content.startswith(b"PAR1")
    assert httpx.get(f"{address}api/coach/sample/shots.csv").text.startswith("id,recorded,player")
    assert httpx.get(f"{address}api/coach/sample/report.pdf?language=de", timeout=240).content.startswith(b"%PDF")
    assert httpx.get(f"{address}api/coach/sample/shots.txt").status_code == 422
    pictures = httpx.get(f"{address}api/coach/sample/pictures/1")
    assert pictures.content.startswith(b"\x89PNG")
