"""Take README's pictures of the pages in a browser: `uv run python docs/pictures.py [NAME ...]` writes NAME.png."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

DOCS = Path(__file__).parent
CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE_MS = 240_000  # software drawing on a busy machine
AT_REST_MS = 3000  # the viewer paints on for a while


def shown(page: Any) -> None:
    """Wait for the viewer's picture."""
    page.wait_for_selector("body[data-shown]", state="attached")


def swept(page: Any) -> None:
    """Have the pad swept."""
    shown(page)
    for title in ("Result", "Parameter sweep"):  # the one closed, the other opened
        page.locator(f"#side details[data-title='{title}'] > summary").click()
    panel = page.locator("#side details[data-title='Parameter sweep']")
    panel.locator("button.primary").click()
    panel.locator(".chart .point").first.wait_for()
    panel.locator("progress").wait_for(state="hidden")


def alone(page: Any) -> None:
    """Show the shot alone."""
    shown(page)
    page.click("#coach")
    page.wait_for_selector("#leave", state="visible")


def turning(page: Any) -> None:
    """Wait for the coach's shot."""
    page.wait_for_selector("section.shot canvas.ball")


@dataclass(frozen=True)
class PagePicture:
    """A picture of a page: the command that serves it, the address's end, the window, what is done before."""

    command: tuple[str, ...]
    place: str
    width_px: int
    height_px: int
    prepare: Callable[[Any], None]


PICTURES = {
    "viewer_all_stages": PagePicture(("view",), "t=60000", 1920, 1080, shown),
    "viewer_spin": PagePicture(("view", "--layout", "spin"), "t=90000", 1920, 1080, shown),
    "tuner": PagePicture(("tune",), "t=60000&tab=Tracker", 1600, 1000, swept),
    "tuner_coach": PagePicture(("tune",), "t=60000&tab=Coach", 1280, 720, alone),
    "coach_shot": PagePicture(("coach",), "shot/28", 1280, 800, turning),
}
DEFAULT = str(DOCS.parent / "sample_recordings/flight_fast_top.h5")


@contextmanager
def served(command: tuple[str, ...]) -> Iterator[str]:
    """Address of a page served by a command, as long as it is needed."""
    name, *options = command
    recording = [] if name == "coach" else [DEFAULT]
    line = [sys.executable, "-m", "spinscope", name, *recording, *options, "--no-browser", "--port", "0"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        yield next(found[0] for said in process.stdout if (found := re.search(r"http://127\.0\.0\.1:\S+", said)))
        process.terminate()


def take(name: str, browser: Any) -> None:
    """Take one picture."""
    wanted = PICTURES[name]
    with served(wanted.command) as address:
        page = browser.new_page(viewport={"width": wanted.width_px, "height": wanted.height_px}, locale="en")
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{address.partition('#')[0]}#{wanted.place}")
        wanted.prepare(page)
        page.wait_for_timeout(AT_REST_MS)
        page.screenshot(path=str(DOCS / f"{name}.png"))
        page.close()


if __name__ == "__main__":
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for each in sys.argv[1:] or PICTURES:
            take(each, chromium)
        chromium.close()
