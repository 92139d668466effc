"""The coach's page in a browser's tab, for tests."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from tests.app.web.browser_tab import pauses

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
PATIENCE_MS = 120_000
PLACES = ("shots", "shot/29", "pair/4/19", "compare", "tests", "live")

needs_browser = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"there is no browser at {CHROMIUM}"),
]


class CoachTab:
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
        end, waiting = time.monotonic() + PATIENCE_MS / 1000, pauses(self.page)
        while not self.page.evaluate(holds):
            assert time.monotonic() < end, holds
            next(waiting)

    def texts(self, selector: str) -> list[str]:
        return [str(text) for text in self.page.locator(selector).all_inner_texts()]

    def close(self) -> None:
        self.context.close()
        assert self.errors == []
