"""What stands behind the page: measures, drawings made once, messages that replace each other."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.app.viewer.tuning import Drawings, compared, layout_bytes, rrd_bytes, tab_names
from spinscope.app.web.bench import LATE, Bench
from spinscope.app.web.jobs import Job, fault
from spinscope.app.web.measures import _jitter_px, coach_sentence, measures
from spinscope.app.web.outbox import Outbox
from spinscope.app.web.page import Page, Wanted
from spinscope.app.web.runs import Finished, finish
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.results import Circle, SpinEstimate
from spinscope.pipeline.session import Choices
from spinscope.pipeline.spin_terms import kind_of_spin

from .conftest import Client


@pytest.fixture(scope="module")
def bench(samples: Path) -> Bench:
    return Bench.open(samples / "flight_fast_top.h5", Choices())


@pytest.fixture(scope="module")
def finished(bench: Bench) -> Finished:
    return finish(bench.clip(*bench.first_clip_us()), bench.session.parameters, lambda: None)


def test_the_jitter_of_a_smooth_track_is_the_noise_put_on_it() -> None:
    random = np.random.default_rng(3)
    sigma = 0.2
    places = np.stack([np.linspace(0, 800, 400), np.linspace(0, 300, 400)], axis=1) + sigma * random.standard_normal(
        (400, 2)
    )
    ticks: list[Any] = [
        SimpleNamespace(track=SimpleNamespace(measured=Circle(x, y, 20.0, 1.0), shot=0)) for x, y in places
    ]
    assert _jitter_px(ticks) == pytest.approx(sigma, rel=0.1)
    assert _jitter_px(ticks[:2]) is None


def test_measures_hold_numbers_only_and_agree_with_the_ticks(finished: Finished) -> None:
    found = measures(finished.session, finished.ticks, finished.shots, finished.no_shot_reason)
    assert found["ticks"] == len(finished.ticks)
    assert found["logo_events"] == sum(len(tick.logo.events) for tick in finished.ticks)
    estimate = found["shots"][0]["spin"]["triplet"]
    own = finished.shots[0].estimates["triplet"]
    assert estimate["magnitude_rps"] == own.magnitude_rps
    # By the cosine rule from what else is told: |spin - truth| / |truth|.
    truth = finished.session.truth
    assert truth is not None and own.magnitude_rps is not None
    size = float(np.linalg.norm(truth.spin_rps[len(truth.t_us) // 2]))
    angle = np.radians(estimate["error_deg"])
    gap = np.sqrt(size**2 + own.magnitude_rps**2 - 2 * size * own.magnitude_rps * np.cos(angle))
    assert estimate["error_share"] == pytest.approx(gap / size, rel=0.02)


def test_what_did_not_change_is_not_drawn_again(bench: Bench, finished: Finished) -> None:
    clip = bench.clip(*bench.first_clip_us())
    drawings = Drawings()
    try:
        first = drawings.chunks(finished.run, clip.keys(bench.session.parameters))
        again = drawings.chunks(finished.run, clip.keys(bench.session.parameters))
        assert all(a is b for a, b in zip(first, again, strict=True))
        other = bench.session.parameters.with_assignments(["logo.pad_px=5"])
        changed = drawings.chunks(finish(clip, other, lambda: None).run, clip.keys(other))
        same = {c.entity_path for c in changed if not c.is_static and any(c is f for f in first)}
        assert {"/image/events", "/image/surface", "/plots/x/kalman"} <= same
        assert "/image/ball/logo" not in same
    finally:
        drawings.close()


def test_drawings_keep_to_their_budget(finished: Finished, bench: Bench) -> None:
    drawings = Drawings(budget_bytes=1)
    try:
        keys = bench.clip(*bench.first_clip_us()).keys(bench.session.parameters)
        assert drawings.chunks(finished.run, keys)
        drawings.keep_budget()
        assert len(drawings._made) == 1
    finally:
        drawings.close()


def test_drawings_are_sorted_out_while_wishes_never_cease(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.app.web.page.IDLE_S", 60.0)
    monkeypatch.setattr("spinscope.app.web.page.UNTIDIED_MOST", 2)
    drawings, sorted_out = Drawings(), list[int]()
    monkeypatch.setattr(drawings, "keep_budget", lambda: sorted_out.append(1))
    page = Page(bench, drawings)
    try:
        for serial in range(5):
            parameters = bench.session.parameters.with_assignments([f"logo.pad_px={2 + serial / 10}"])
            before, until = page.finished, time.monotonic() + 30
            page.ask(Wanted(serial, parameters, None, bench.first_clip_us()))
            while page.finished is before and time.monotonic() < until:
                time.sleep(0.01)
            assert page.finished is not before
    finally:
        page.close()
        page.join(10)
        drawings.close()
    assert len(sorted_out) == 2
    for thread in threading.enumerate():
        if page.id in thread.name:
            thread.join(10)
            assert not thread.is_alive()


def test_the_layout_has_a_tab_for_every_view(finished: Finished) -> None:
    assert tab_names() == ["All stages", "Tracker", "Logo and flow", "Spin", "Compare", "Coach"]
    for tab in ("", "Coach", "nothing"):
        assert layout_bytes(finished.run, tab).startswith(b"RRF2")


def test_a_recording_of_a_and_b_is_whole(finished: Finished, bench: Bench) -> None:
    drawings = Drawings()
    try:
        chunks = drawings.chunks(finished.run, bench.clip(*bench.first_clip_us()).keys(bench.session.parameters))
    finally:
        drawings.close()
    both = rrd_bytes([*chunks, *compared(chunks)], "both")
    assert len(both) > 1.5 * len(rrd_bytes(chunks, "one"))


def test_an_old_message_of_a_kind_gives_way_to_a_newer_one() -> None:
    async def read() -> list[dict[str, Any]]:
        outbox = Outbox()
        for share in range(100):
            outbox.put("run", share=share)
        outbox.put("curve", points=3)
        found = []
        async for message in outbox.messages():
            found.append(message)
            if len(found) == 2:
                outbox.close()
        return found

    assert asyncio.run(read()) == [{"kind": "run", "share": 99}, {"kind": "curve", "points": 3}]


def test_word_of_progress_does_not_take_a_pictures_place() -> None:
    async def read() -> list[str]:
        outbox = Outbox()
        for content in ({"state": "a"}, {"state": "b", "recording": "1"}, {"state": "c"}, {"state": "d"}):
            outbox.put("run", **content)
        found = []
        async for message in outbox.messages():
            found.append(message["state"])
            if len(found) == 2:
                outbox.close()
        return found

    assert asyncio.run(read()) == ["b", "d"]


def test_a_job_tells_how_it_ended_and_stops_when_asked() -> None:
    outbox = Outbox()

    def told() -> dict[str, Any]:
        return outbox._waiting["work"]

    def fail(_: Job) -> dict[str, Any]:
        raise ParameterError("the knob is loose")

    Job("work", outbox, lambda _: {"answer": 42})._thread.join(5)
    assert told() == {"kind": "work", "state": "done", "answer": 42}
    Job("work", outbox, fail)._thread.join(5)
    assert told() == {"kind": "work", "state": "failed", "error": "the knob is loose"}
    began = threading.Event()

    def endless(job: Job) -> dict[str, Any]:
        while True:
            began.set()
            job.check()
            time.sleep(0.001)

    job = Job("work", outbox, endless)
    assert began.wait(5)
    job.cancel(5)
    assert told() == {"kind": "work", "state": "cancelled"}


def test_a_fault_is_one_line_that_names_the_stage() -> None:
    assert fault(ParameterError("too loud")) == "too loud"
    try:
        raise ValueError("two\nlines")
    except ValueError as error:
        assert fault(error) == "the tuner failed: ValueError: two lines"


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """All messages on runs; a page on a busy machine may read but the newest."""
    messages: list[dict[str, Any]] = []
    put = Outbox.put

    def noted(outbox: Outbox, kind: str, **content: Any) -> None:
        if kind == "run":
            messages.append(content)
        put(outbox, kind, **content)

    monkeypatch.setattr(Outbox, "put", noted)
    return messages


def test_what_is_seen_at_the_playhead_comes_first_when_the_rest_takes_long(
    client: Client, monkeypatch: pytest.MonkeyPatch, told: list[dict[str, Any]]
) -> None:
    monkeypatch.setattr("spinscope.app.web.page.REST_WORTH_WAITING_S", 0.0)
    start_us, end_us = client.opening["recording"]["clip_us"]
    middle_us = (start_us + end_us) / 2
    done = client.run({"surface": {"k_px": 13}}, playhead_us=middle_us)
    parts = [m for m in told if m["state"] == "partial"]
    assert len(parts) == 1
    assert middle_us <= parts[0]["end_us"] < done["end_us"]
    assert client.http.get(client.path(f"pictures/{parts[0]['recording']}")).status_code == 200


def test_a_dragged_slider_gets_a_picture_without_the_slowest_stage_first(
    client: Client, told: list[dict[str, Any]]
) -> None:
    done = client.run({"logo": {"pad_px": 3.3}}, hasty=True)
    assert set(done["measures"]["shots"][0]["spin"]) == {"triplet", "normal_flow", "contrast"}
    (first,) = (m for m in told if m["state"] == "partial")
    assert set(first["measures"]["shots"][0]["spin"]) == {"triplet", "normal_flow"}
    assert first["end_us"] == done["end_us"] and first["recording"] != done["recording"]
    told.clear()
    client.run({"logo": {"pad_px": 3.3}}, hasty=True)
    assert not [m for m in told if m["state"] == "partial"]


def test_what_is_drawn_early_is_drawn_once(bench: Bench) -> None:
    clip = bench.clip(*bench.first_clip_us())
    parameters = bench.session.parameters.with_assignments(["logo.pad_px=3.7"])
    early = Finished.of(clip.with_parameters(parameters), [step.tick for step in clip.run(parameters, LATE)])
    whole = finish(clip, parameters, lambda: None)
    assert early.ticks[0].contrast is None and whole.ticks[0].contrast is not None
    drawings, keys = Drawings(), clip.keys(parameters)
    try:
        drawings.begin(early.run, keys)
        without, with_late = drawings.chunks(early.run, keys), drawings.chunks(whole.run, keys)
    finally:
        drawings.close()
    with_late = [chunk for chunk in with_late if not chunk.is_static]
    same = {chunk.entity_path for chunk in with_late if any(chunk is other for other in without)}
    assert {"/image/events", "/image/surface", "/image/ball/logo"} <= same
    assert not {path for path in same if "contrast" in path or path.startswith("/world")}


def test_a_drawing_that_fails_is_tried_again(finished: Finished, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: Any) -> list[Any]:
        raise ValueError("no paint")

    drawings, keys = Drawings(), bench.clip(*bench.first_clip_us()).keys(bench.session.parameters)
    try:
        with monkeypatch.context() as patch:
            patch.setattr("spinscope.app.viewer.tuning.DRAWERS", ((broken, "filter"),))
            with pytest.raises(ValueError, match="no paint"):
                drawings.chunks(finished.run, keys)
        assert drawings.chunks(finished.run, keys)
    finally:
        drawings.close()


def test_the_coach_is_told_in_one_sentence() -> None:
    up, forward = (0.0, 0.0, -1.0), np.array([8.9, 0.0, 0.0])
    spin = 54.0 * np.array([0.0, -np.cos(np.radians(12)), np.sin(np.radians(12))])
    estimate = SpinEstimate("contrast", spin, 4.0 * np.eye(3), None)
    said = coach_sentence(estimate, kind_of_spin(spin, forward, up), forward)
    assert said == "Topspin 54 rps (3240 rpm), 32 km/h, axis 12 degrees off pure topspin, ±2 rps"
    in_place = coach_sentence(estimate, kind_of_spin(spin, None, up), None)
    assert in_place == "Spin 54 rps (3240 rpm), axis up the image, 12 degrees off, ±2 rps"
    assert coach_sentence(None, None, forward) == "Spin not known, 32 km/h"


def test_the_background_makes_way_while_somebody_waits(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.app.web.bench.MAKE_WAY_S", 60.0)
    done = threading.Event()

    def background() -> None:
        bench.make_way()
        done.set()

    with bench.at_work(), bench.at_work():
        thread = threading.Thread(target=background)
        thread.start()
        assert not done.wait(0.05)
    assert done.wait(10)
    thread.join()
