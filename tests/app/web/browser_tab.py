"""A tab of a real browser with the page in it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Error

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # the page around the viewer without OpenGL: a third of the computing
    "--disable-dev-shm-usage",
]
SIZE = {"width": 760, "height": 480}  # software drawing is slow: a small window
PATIENCE_MS = 240_000  # a loaded machine draws a hundred times slower

needs_browser = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"there is no browser at {CHROMIUM}"),
]


def pauses(page: Any) -> Iterator[None]:
    """Let the page go on, each time a little longer: to ask it costs 6 ms of computing, also of what it waits for."""
    pause_ms = 15.0
    while True:
        page.wait_for_timeout(pause_ms)
        pause_ms = min(1.25 * pause_ms, 200.0)
        yield


class Tab:
    """A tab with the page in it."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.requests: list[str] = []
        self.errors: list[str] = []
        page.set_default_timeout(PATIENCE_MS)
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.add_init_script(
            """window.violations = [];
            document.addEventListener("securitypolicyviolation", ({ violatedDirective, blockedURI, sourceFile }) =>
                window.violations.push(`${violatedDirective}: ${blockedURI} ${sourceFile}`));"""
        )

    def open(self, address: str) -> None:
        self.page.goto(address)
        self.page.wait_for_selector("body[data-done]", state="attached")

    @property
    def serial(self) -> int:
        """The newest request that the page has sent."""
        return int(self.page.evaluate("window.spinscope.runner.serial"))

    def settled(self, what: str = "done") -> None:
        """Wait until the newest request is done: computed (done) or to be seen (shown)."""
        self.until(
            f"document.body.dataset.{what} === String(window.spinscope.runner.serial)",
            lambda: f"not {what}: {self.page.inner_text('#bar')} {self.page.inner_text('#notices')}",
        )

    def after(self, act: Any, what: str = "done") -> None:
        """Do something that makes the page send a request, and wait until that is done."""
        before = self.serial
        act()
        self.until(f"window.spinscope.runner.serial > {before}", lambda: "nothing was asked of the server")
        self.settled(what)

    def slide(self, name: str, key: str = "ArrowUp", what: str = "done") -> None:
        """Press a key on a slider."""
        slider = self.page.locator(f"[data-name='{name}'] input[type=range]")
        slider.evaluate("(slider) => { slider.closest('details').open = true; }")
        self.after(lambda: slider.press(key), what)

    def until(self, holds: str, says: Callable[[], str] | None = None) -> None:
        """Wait until an expression holds in the page, which may be loaded anew meanwhile; what is said where not."""
        end, waiting = time.monotonic() + PATIENCE_MS / 1000, pauses(self.page)
        while not self._holds(holds):
            assert time.monotonic() < end, says() if says else holds
            next(waiting)

    def _holds(self, expression: str) -> bool:
        try:
            return bool(self.page.evaluate(expression))
        except Error as error:
            if "context was destroyed" not in str(error):
                raise
            return False

    def value(self, name: str) -> Any:
        return self.page.evaluate(f"window.spinscope.settings.get('{name}')")

    def computed(self) -> set[str]:
        """The stages whose cells in the bar say that they ran."""
        cells = self.page.locator("#bar .stage:not(.kept)")
        return {cell.get_attribute("data-stage") for cell in cells.all()} - {"drawing"}

    def where(self) -> dict[str, Any]:
        """Playhead (us) and play state of the viewer."""
        found: dict[str, Any] = self.page.evaluate(
            """window.spinscope.viewer.api.get_state().then((state) => {
                const found = state.recordings.find(({ store_id }) => store_id === state.active_store_id);
                const { time } = found.current_time;
                return { time: Number(typeof time === "object" ? time.value : time) / 1000, play: found.play_state };
            })"""
        )
        return found

    def panel(self, title: str) -> Any:
        """A panel of tools or settings, opened."""
        details = self.page.locator(f"details[data-title='{title}']")
        if details.get_attribute("open") is None:
            details.locator("> summary").click()
        return details


def bare_tab(browser: Any, address: str) -> Tab:
    """A page without the viewer, whose program takes ten seconds to start in software."""
    context = browser.new_context(viewport=SIZE)
    made = Tab(context.new_page())
    made.page.route(re.compile(r"re_viewer_bg\.wasm"), lambda route: route.abort())
    made.open(address)
    made.settled()
    made.until("window.spinscope.runner.isBlind")
    return made


def serious(page: Any) -> list[str]:
    """Rules that are broken so that somebody cannot use the page, and where."""
    found = Axe().run(page).response["violations"]
    return [
        f"{one['id']}: {', '.join(str(node['target']) for node in one['nodes'])}"
        for one in found
        if one["impact"] in ("serious", "critical")
    ]
