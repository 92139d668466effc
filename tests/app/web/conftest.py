"""A web application that answers, on a free port of this machine, in this process."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn

from spinscope.app.web.app_state import AppState
from spinscope.app.web.application import application
from spinscope.app.web.server import listening_socket
from spinscope.pipeline.session import Choices, Session

from .browser_tab import CHROMIUM, FLAGS, SIZE, Tab, bare_tab

PATIENCE_S = 300.0  # the first run on a machine compiles the kernels
PLAIN: dict[str, Any] = {"verify": False}  # reading the certificates takes a client longer than a test's requests


@dataclass
class Served:
    """A server and its state, and how to stop it."""

    address: str
    state: AppState
    stop: Callable[[], None]
    clients: list[Client] = field(default_factory=list)

    def open(self, recording: str | None = None) -> Client:
        """A new page that listens; closed with the server at the latest."""
        http = httpx.Client(timeout=240.0, **PLAIN)
        answer = http.post(f"{self.address}api/sessions", json={"recording": recording})
        assert answer.status_code == 200, answer.text
        client = Client(self.address, answer.json(), http)
        client.listener = threading.Thread(target=client.listen, daemon=True)
        client.listener.start()
        self.clients.append(client)
        return client

    def close(self, client: Client) -> None:
        """End a page and its threads."""
        self.clients.remove(client)
        session = self.state.sessions.get(client.opening["session"])
        if session is not None:
            self.state.close_session(session)
            session.join(10)
        client.listener.join(10)
        client.http.close()


def served(path: Path, port: int = 0, choices: Choices | None = None, **options: Any) -> Served:
    """Start serving a recording."""
    state = AppState(path, choices or Choices(), **options)
    listening = listening_socket(port)
    config = uvicorn.Config(application(state), log_level="error", timeout_graceful_shutdown=2)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=lambda: server.run([listening]), daemon=True)
    thread.start()

    def stop() -> None:
        for client in list(made.clients):
            made.close(client)
        state.close()
        server.should_exit = True
        thread.join(10)
        listening.close()

    made = Served(f"http://127.0.0.1:{listening.getsockname()[1]}/", state, stop)
    return made


@pytest.fixture(scope="session")
def flight(samples: Path) -> Path:
    """The default sample."""
    return samples / "flight_fast_top.h5"


@pytest.fixture(scope="session")
def tuner(flight: Path) -> Iterator[Served]:
    """A tuner on the default sample; the kernels are compiled by now, however long that takes: pages have a limit."""
    Session.open(flight).estimate()
    made = served(flight)
    yield made
    made.stop()


@dataclass
class Client:
    """A page without a browser: asks, listens, fetches."""

    address: str
    opening: dict[str, Any]
    http: httpx.Client
    serial: int = 0
    messages: list[dict[str, Any]] = field(default_factory=list)
    listener: threading.Thread = field(default_factory=threading.Thread)
    _arrived: threading.Condition = field(default_factory=threading.Condition)

    def path(self, rest: str) -> str:
        return f"{self.address}api/sessions/{self.opening['session']}/{rest}"

    def listen(self) -> None:
        """Gather the messages until the server ends them."""
        with httpx.stream("GET", self.path("messages"), timeout=None, **PLAIN) as stream:
            for line in stream.iter_lines():
                if line.startswith("data: "):
                    with self._arrived:
                        self.messages.append(json.loads(line.removeprefix("data: ")))
                        self._arrived.notify_all()

    def request(self, parameters: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
        """A run request of the next serial."""
        self.serial += 1
        start_us, end_us = self.opening["recording"]["clip_us"]
        request = {"serial": self.serial, "parameters": parameters or {}, "start_us": start_us, "end_us": end_us}
        return {**request, **more}

    def run(self, parameters: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
        """Ask for a run and wait for its end; the last message on it."""
        request = self.request(parameters, **more)
        answer = self.http.post(self.path("run"), json=request)
        assert answer.status_code == 202, answer.text
        return self.wait("run", lambda m: m["serial"] == request["serial"] and m["state"] in ("done", "failed"))

    def wait(self, kind: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first message of a kind for which something holds."""

        def found() -> list[dict[str, Any]]:
            return [message for message in self.messages if message["kind"] == kind and holds(message)]

        with self._arrived:
            assert self._arrived.wait_for(lambda: bool(found()), PATIENCE_S), self.messages[-3:]
            return found()[0]

    def post(self, rest: str, **content: Any) -> httpx.Response:
        """Any other request of the page."""
        return self.http.post(self.path(rest), json=content)


@pytest.fixture
def client(tuner: Served) -> Iterator[Client]:
    """A new page on the default sample."""
    made = tuner.open()
    yield made
    tuner.close(made)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """One chromium for all tests."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield made
        made.close()


@pytest.fixture(scope="module")
def tab(browser: Any, tuner: Served) -> Iterator[Tab]:
    """The page with its viewer, on the tracker's tab, which draws fastest."""
    context = browser.new_context(viewport=SIZE)
    made = Tab(context.new_page())
    made.open(f"{tuner.address}#tab=Tracker")
    made.settled("shown")
    yield made
    context.close()


@pytest.fixture(scope="module")
def bare(browser: Any, tuner: Served) -> Iterator[Tab]:
    """The page without the viewer, whose pictures take seconds each."""
    made = bare_tab(browser, tuner.address)
    for notice in made.page.locator(".notice").all():  # that the viewer does not run
        notice.click()
    yield made
    made.page.context.close()
