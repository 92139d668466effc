"""A server of the coach's page, a browser, and a tab of it."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from spinscope.app.coach.session import ShotSession
from spinscope.app.coach.session_folders import SAMPLE
from spinscope.app.web.coach_application import CoachState, coach_application
from spinscope.app.web.server import listening_socket

from .coach_tab import CHROMIUM, FLAGS, CoachTab
from .session_shots import KNOWN, analysis, shot


@pytest.fixture
def session(tmp_path: Path) -> ShotSession:
    shutil.copytree(SAMPLE, tmp_path / "sample")
    return ShotSession(tmp_path / "sample")


@pytest.fixture
def earlier(tmp_path: Path) -> ShotSession:
    """Four topspins of player A half a year before."""
    made = ShotSession(tmp_path / "earlier")
    shots = [shot(i, 200_000 * i, 200_000 * i + 90_000, spin_rps=30.0 + i, topspin_rps=30.0 + i) for i in range(4)]
    ids = made.add("spring.raw", KNOWN, analysis(*(replace(one, recorded_s=1.775e9 + one.shot) for one in shots)))
    made.name_shots(ids, {"player": "A"})
    return made


@pytest.fixture
def address(session: ShotSession, earlier: ShotSession) -> Iterator[str]:
    """A server of the sample's copy and an earlier session."""
    state = CoachState([session, earlier])
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


@pytest.fixture
def tab(browser: Any, address: str) -> Iterator[CoachTab]:
    made = CoachTab(browser, address)
    yield made
    made.close()
