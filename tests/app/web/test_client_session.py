"""Client sessions: coalescing queues, jobs, runs."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from spinscope.app.tuning.bias_sweep import Resimulation
from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.app.web.client_session import ClientSession
from spinscope.app.web.jobs import Job, error_text
from spinscope.app.web.message_queue import MessageQueue, RequestQueue, Superseded
from spinscope.app.web.message_schemas import BiasesMessage, Picture, RunMessage, ServerMessage, ShotsMessage
from spinscope.app.web.open_recording import OpenRecording
from spinscope.app.web.publisher import PICTURES_LEAST
from spinscope.app.web.schemas import RunRequest
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.session import Choices

from .conftest import Client, Served


@pytest.fixture(scope="module")
def recording(samples: Path) -> OpenRecording:
    return OpenRecording.open(samples / "flight_fast_top.h5", Choices())


def test_drawings_are_sorted_out_while_requests_never_cease(
    recording: OpenRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spinscope.app.web.runner.IDLE_S", 60.0)
    monkeypatch.setattr("spinscope.app.web.runner.REQUESTS_MOST", 2)
    drawings, sorted_out = DrawingCache(), list[int]()
    monkeypatch.setattr(drawings, "keep_budget", lambda: sorted_out.append(1))
    session = ClientSession(recording, drawings)
    start_us, end_us = recording.first_clip_us()
    try:
        for serial in range(5):
            values = {"logo": {"pad_px": 2 + serial / 10}}
            before, until = session.runner.result, time.monotonic() + 240
            session.requests.put(RunRequest(serial=serial, parameters=values, start_us=start_us, end_us=end_us))
            while session.runner.result is before and time.monotonic() < until:
                time.sleep(0.01)
            assert session.runner.result is not before
    finally:
        session.close()
        session.join(10)
        drawings.close()
    assert len(sorted_out) == 2
    assert not session.runner._thread.is_alive()


def progress(state: str = "computing", picture: str | None = None, share: float = 0.0) -> RunMessage:
    sizes = {"size_bytes": 1, "start_us": 0, "end_us": 1, "opening_us": 0}
    made = None if picture is None else Picture(id=picture, seen_shots=[[]], **sizes)
    return RunMessage(serial=1, state=state, share=share, stages_ms={}, total_ms=0.0, picture=made)


def read(queue: MessageQueue, count: int) -> list[ServerMessage]:
    """The first messages of a queue."""

    async def reading() -> list[ServerMessage]:
        found = []
        async for message in queue.messages():
            found.append(message)
            if len(found) == count:
                queue.close()
        return found

    return asyncio.run(reading())


def test_an_old_message_of_a_kind_gives_way_to_a_newer_one() -> None:
    queue = MessageQueue()
    for share in range(100):
        queue.put(progress(share=share))
    queue.put(ShotsMessage(share=1.0, shots=[(3, 5)]))
    assert read(queue, 2) == [progress(share=99), ShotsMessage(share=1.0, shots=[(3, 5)])]


def test_progress_does_not_take_the_place_of_an_unread_picture() -> None:
    queue = MessageQueue()
    for message in (progress(), progress("partial", "1"), progress("drawing"), progress("loading")):
        queue.put(message)
    assert [message.state for message in read(queue, 2)] == ["partial", "loading"]


def test_the_newest_request_supersedes_those_before_it() -> None:
    requests = RequestQueue()
    old, new = (RunRequest(serial=serial, parameters={}, start_us=0, end_us=1) for serial in (4, 7))
    assert requests.get(0.0) is None
    assert requests.put(old) and requests.put(new)
    assert not requests.put(old) and not requests.put(new)
    assert requests.get() is new
    assert requests.get(0.0) is None
    requests.check(new)
    with pytest.raises(Superseded):
        requests.check(old)
    requests.close()
    for ended in (requests.get, lambda: requests.check(new)):
        with pytest.raises(Superseded):
            ended()


def test_a_job_tells_how_it_ended_and_stops_when_asked() -> None:
    queue = MessageQueue()
    content = Resimulation(1.0, {"diff_on": 3})

    def fail(_: Job) -> Resimulation:
        raise ParameterError("the bias is out of range")

    Job(BiasesMessage, queue, lambda _: content)._thread.join(60)
    assert queue._waiting["biases", False] == BiasesMessage(state="done", content=content)
    Job(BiasesMessage, queue, fail)._thread.join(60)
    assert queue._waiting["biases", False] == BiasesMessage(state="failed", error="the bias is out of range")
    began = threading.Event()

    def endless(job: Job) -> Resimulation:
        while True:
            began.set()
            job.check()
            time.sleep(0.001)

    job = Job(BiasesMessage, queue, endless)
    assert began.wait(240)
    job.cancel(60)
    assert queue._waiting["biases", False] == BiasesMessage(state="cancelled")


@pytest.mark.parametrize(
    ("module", "said"),
    [
        ("spinscope.pipeline.stages.logo", "logo failed: ValueError: two lines"),
        ("spinscope.pipeline.spin.contrast.stage", "contrast failed: ValueError: two lines"),
        ("elsewhere", "the server failed: ValueError: two lines"),
    ],
)
def test_an_error_is_one_line_that_names_the_stage(module: str, said: str) -> None:
    namespace: dict[str, Any] = {"__name__": module}
    exec("def step():\n    raise ValueError('two\\nlines')", namespace)
    with pytest.raises(ValueError, match="two") as raised:
        namespace["step"]()
    assert error_text(raised.value) == said
    assert error_text(ParameterError("too high")) == "too high"


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """All messages on runs; a page on a busy machine may read but the newest."""
    messages: list[dict[str, Any]] = []
    put = MessageQueue.put

    def noted(queue: MessageQueue, message: ServerMessage) -> None:
        if message.kind == "run":
            messages.append(message.model_dump(mode="json"))
        put(queue, message)

    monkeypatch.setattr(MessageQueue, "put", noted)
    return messages


def test_what_is_seen_at_the_playhead_comes_first_when_the_rest_takes_long(
    client: Client, monkeypatch: pytest.MonkeyPatch, told: list[dict[str, Any]]
) -> None:
    monkeypatch.setattr("spinscope.app.web.runner.REST_WORTH_WAITING_S", 0.0)
    start_us, end_us = client.opening["recording"]["clip_us"]
    middle_us = (start_us + end_us) / 2
    done = client.run({"surface": {"k_px": 13}}, playhead_us=middle_us)
    parts = [m for m in told if m["state"] == "partial"]
    assert len(parts) == 1
    assert middle_us <= parts[0]["picture"]["end_us"] < done["picture"]["end_us"]
    assert client.http.get(client.path(f"pictures/{parts[0]['picture']['id']}")).status_code == 200


def test_a_dragged_slider_gets_a_picture_without_the_slowest_stage_first(
    client: Client, told: list[dict[str, Any]]
) -> None:
    done = client.run({"logo": {"pad_px": 3.37}}, interactive=True)
    assert set(done["metrics"]["shots"][0]["spin"]) == {"triplet", "normal_flow", "contrast", "trajectory", "combined"}
    (first,) = (m for m in told if m["state"] == "partial")
    assert set(first["metrics"]["shots"][0]["spin"]) == {"triplet", "normal_flow", "trajectory"}
    assert first["picture"]["end_us"] == done["picture"]["end_us"] and first["picture"]["id"] != done["picture"]["id"]
    told.clear()
    client.run({"logo": {"pad_px": 3.37}}, interactive=True)
    assert not [m for m in told if m["state"] == "partial"]


def test_a_slider_that_is_dragged_on_has_previews_and_no_pictures_drawn(
    client: Client, told: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spinscope.app.web.runner.DRAG_REST_S", 60.0)
    for pad_px in (3.41, 3.42, 3.41):  # the last one is known
        request = client.request({"logo": {"pad_px": pad_px}}, interactive=True)
        client.http.post(client.path("run"), json=request)
        client.wait("preview", lambda m, request=request: m["serial"] == request["serial"])
    done = client.run({"logo": {"pad_px": 3.43}})  # let go of
    assert {m["serial"] for m in told if m["picture"]} == {done["serial"]}


def test_the_way_back_finds_the_picture_that_was_made(
    client: Client, tuner: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    def picture(pad_px: float, **more: Any) -> tuple[str, bytes]:
        made = client.run({"logo": {"pad_px": pad_px}}, **more)["picture"]["id"]
        return made, client.http.get(client.path(f"pictures/{made}")).content

    first, other, pinned = picture(3.1), picture(3.2), picture(3.1, pinned={})
    assert len({first, other, pinned}) == 3
    assert picture(3.1) == first and picture(3.1, pinned={}) == pinned
    monkeypatch.setattr("spinscope.app.web.publisher.PICTURES_BYTES", 1)
    kept = [picture(pad_px)[0] for pad_px in (3.3, 3.4, 3.5, 3.6)][-PICTURES_LEAST:]
    publisher = tuner.state.sessions[client.opening["session"]].publisher
    assert [one for one in (first[0], *kept) if publisher.picture(one)] == kept


def test_the_background_makes_way_while_somebody_waits(
    recording: OpenRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spinscope.app.web.open_recording.MAKE_WAY_S", 60.0)
    done = threading.Event()

    def background() -> None:
        recording.make_way()
        done.set()

    with recording.at_work(), recording.at_work():
        thread = threading.Thread(target=background)
        thread.start()
        assert not done.wait(0.05)
    assert done.wait(240)
    thread.join()
