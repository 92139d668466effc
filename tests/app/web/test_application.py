"""Web application without a browser: runs, refusals, two sessions, presets, exports."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import shlex
import time
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from click.testing import CliRunner
from pyarrow import parquet
from rerun.chunk import RrdReader

from spinscope.app.cli import cli
from spinscope.app.web import video_routes
from spinscope.app.web.app_state import SESSIONS_MOST, AppState
from spinscope.app.web.open_recording import OpenRecording
from spinscope.pipeline.registry import STAGES, Parameters, default_stages, needed_stages
from spinscope.pipeline.session import Choices

from .conftest import Client, Served


def stages_run(done: dict[str, Any]) -> set[str]:
    """The stages that had to be computed for this answer."""
    return {stage for stage, ms in done["stages_ms"].items() if ms > 0 and stage in STAGES.names}


def test_a_run_gives_a_picture_that_rerun_can_read_and_numbers_near_the_truth(client: Client, tmp_path: Path) -> None:
    done = client.run()
    assert done["state"] == "done"
    picture = client.http.get(client.path(f"pictures/{done['picture']['id']}"))
    assert picture.status_code == 200
    path = tmp_path / "run.rrd"
    path.write_bytes(picture.content)
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert {"/image/events", "/image/surface", "/plots/x/kalman", "/compare"} <= entities
    shot = done["metrics"]["shots"][0]
    assert shot["spin"]["triplet"]["error_rps"] < 2.0
    assert done["metrics"]["tracked_share"] > 0.8


@pytest.mark.parametrize(
    ("stage", "field", "value"),
    [
        ("filter", "threshold_us", 4000),
        ("surface", "k_px", 8),
        ("surface", "cleaning", "off"),
        ("track", "coast_us", 25_000),
        ("logo", "pad_px", 3.25),
        ("rate", "ema_us", 2500),
        ("flow", "reach_px", 3.5),
        ("spin", "triplet_solve", "least_squares"),
    ],
)
def test_a_change_runs_its_stage_and_those_below_and_going_back_runs_nothing(
    client: Client, stage: str, field: str, value: Any
) -> None:
    value_before = getattr(Parameters().group(stage), field)
    assert value != value_before
    client.run()
    # A value that no other test has run, so that nothing of it is known yet.
    changed = client.run({stage: {field: value}})
    own = {name for name in default_stages() if STAGES[name].group == stage}
    below = {one.name for one in STAGES if own & {needed.name for needed in needed_stages([one.name])}}
    assert own <= stages_run(changed) <= below
    assert stages_run(client.run()) == set()


def test_another_shot_is_followed_without_a_stage_run_again(client: Client) -> None:
    client.run()
    done = client.run(followed=1)
    assert done["state"] == "done" and done["picture"]
    assert stages_run(done) == set()
    answer = client.http.post(client.path("run"), json=client.request(followed=0))
    assert answer.status_code == 422


def test_frames_that_would_not_fit_are_refused(client: Client, tuner: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuner.state.recording(), "max_frame_bytes", 30 * 1280 * 720)
    answer = client.http.post(client.path("run"), json=client.request({"track": {"tick_us": 1000}}))
    assert answer.status_code == 400 and "frames of this clip" in answer.json()["error"]


def test_the_newest_request_wins_and_an_older_one_is_refused(client: Client) -> None:
    client.run()
    old = client.request({"logo": {"pad_px": 4.0}})
    new = client.request({"logo": {"pad_px": 5.0}})
    assert client.http.post(client.path("run"), json=new).status_code == 202
    assert client.http.post(client.path("run"), json=old).status_code == 409
    client.wait("run", lambda m: m["serial"] == new["serial"] and m["state"] == "done")
    assert not [m for m in client.messages if m["serial"] == old["serial"]]


def test_a_burst_of_changes_ends_with_the_last_one(client: Client) -> None:
    requests = [client.request({"surface": {"k_px": k}}) for k in range(3, 15)]
    for request in requests:
        assert client.http.post(client.path("run"), json=request).status_code == 202
    client.wait("run", lambda m: m["serial"] == requests[-1]["serial"] and m["state"] == "done")
    assert client.http.get(client.path("export/results.json")).json()["parameters"]["surface"]["k_px"] == 14
    finished = [m["serial"] for m in client.messages if m["kind"] == "run" and m["state"] == "done"]
    assert finished == sorted(set(finished)) and len(finished) < len(requests)


def test_two_pages_on_one_process_do_not_disturb_each_other(tuner: Served) -> None:
    one, two = tuner.open(), tuner.open()
    assert one.opening["session"] != two.opening["session"]
    first, second = one.request({"logo": {"pad_px": 1.5}}), two.request({"logo": {"pad_px": 6.5}})
    one.http.post(one.path("run"), json=first)
    two.http.post(two.path("run"), json=second)
    ends = [c.wait("run", lambda m: m["state"] == "done") for c in (one, two)]
    events = [end["metrics"]["logo_events"] for end in ends]
    assert events[0] > events[1]
    assert two.http.get(two.path(f"pictures/{ends[0]['picture']['id']}")).status_code == 404


def test_a_and_b_are_in_one_recording_with_a_table_of_what_differs(client: Client, tmp_path: Path) -> None:
    done = client.run({"logo": {"pad_px": 5.0}}, pinned={})
    assert done["differences"] == [["logo.pad_px", Parameters().logo.pad_px, 5.0]]
    assert done["pinned_metrics"]["logo_events"] > done["metrics"]["logo_events"]
    assert set(done["pinned_costs_ms"]) == set(default_stages())
    path = tmp_path / "ab.rrd"
    path.write_bytes(client.http.get(client.path(f"pictures/{done['picture']['id']}")).content)
    chunks = list(RrdReader(path).stream())
    entities = {chunk.entity_path for chunk in chunks}
    assert {"/image/surface", "/A/image/surface", "/plots/spin/triplet", "/A/plots/spin/triplet"} <= entities
    batches = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == "/A/plots/x/kalman"]
    names = [b.column(i)[0].as_py()[0] for b in batches for i, n in enumerate(b.schema.names) if n.endswith(":names")]
    assert "A: " in " ".join(names)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"parameters": {"logo": {"pad_px": -1}}}, "out of range"),
    ({"parameters": {"logo": {"pd_px": 1}}}, "did you mean pad_px"),
    ({"parameters": {"lgo": {}}}, "there is no stage"),
    ({"parameters": {"logo": 3}}, "valid dictionary"),
    ({"parameters": {"logo": {"pad_px": 10**400}}}, "too large"),
    ({"parameters": {"logo": {"pad_px": [1]}}}, "not a number"),
    ({"parameters": {"logo": {"pad_px": True}}}, "not a number"),
    ({"start_us": 90_000, "end_us": 1_000}, "no part of the recording"),
    ({"start_us": -5, "end_us": 10**9}, "no part of the recording"),
    ({"start_us": 1.5}, "integer"),
    ({"serial": -1}, "greater than or equal to 0"),
    ({"unknown": 1}, "Extra inputs"),
    ({"interactive": "yes"}, "valid boolean"),
]


@pytest.mark.parametrize(("content", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_a_bad_request_gets_one_line_and_changes_nothing(client: Client, content: dict[str, Any], said: str) -> None:
    client.run()
    request = {**client.request(), **content}
    answer = client.http.post(client.path("run"), json=request)
    assert 400 <= answer.status_code < 500
    error = answer.json()["error"]
    assert said in error and "\n" not in error and len(error) < 500
    assert client.run()["stages_ms"].keys() and stages_run(client.run()) == set()


@pytest.mark.parametrize(
    "text", ['{"serial": 1, "parameters": {"logo": {"pad_px": NaN}}, "start_us": 5, "end_us": 95703}']
)
def test_not_a_number_is_refused(client: Client, text: str) -> None:
    answer = client.http.post(client.path("run"), content=text, headers={"content-type": "application/json"})
    assert answer.status_code == 400 and "not a number" in answer.json()["error"]


def test_strangers_are_turned_away(tuner: Served) -> None:
    page = f"{tuner.address}api/sessions"
    assert httpx.post(page, json={}, headers={"origin": "http://elsewhere.example"}).status_code == 403
    assert httpx.post(page, json={}, headers={"origin": "null"}).status_code == 403
    for site in ("cross-site", "same-site", "nonsense"):
        assert httpx.post(page, json={}, headers={"sec-fetch-site": site}).status_code == 403
        assert httpx.get(f"{tuner.address}static/main.js", headers={"sec-fetch-site": site}).status_code == 403
    # Origins that only begin or end like ours, or differ in scheme or port.
    own = tuner.address.rstrip("/")
    port = own.rpartition(":")[2]
    for origin in (
        f"{own}0",
        f"{own}.evil.example",
        own.replace("http:", "https:"),
        f"http://localhost:{port}",
        own[:-1],
    ):
        assert httpx.post(page, json={}, headers={"origin": origin}).status_code == 403, origin
    for host in ("elsewhere.example", f"127.0.0.1.elsewhere.example:{port}", f"localhost@evil.example:{port}", ""):
        assert httpx.get(tuner.address, headers={"host": host}).status_code == 421, host
    assert httpx.post(page, content="{}", headers={"content-type": "text/plain"}).status_code == 415
    assert httpx.post(page, json={"recording": "x" * 300_000}).status_code == 413
    assert (
        httpx.post(page, content=iter([b"x" * 200_000] * 3), headers={"content-type": "application/json"}).status_code
        == 413
    )
    assert httpx.post(page, content="{", headers={"content-type": "application/json"}).status_code == 422
    assert httpx.get(f"{tuner.address}api/sessions/none/recording").status_code == 404
    assert httpx.get(f"{tuner.address}nothing").status_code == 404
    assert httpx.get(f"{tuner.address}static/../application.py").status_code == 404
    assert httpx.get(f"{tuner.address}static/%2e%2e/application.py").status_code == 404
    headers = {"origin": own, "sec-fetch-site": "same-origin"}
    assert httpx.post(page, json={}, headers=headers, timeout=240).status_code == 200


def test_the_page_is_reached_through_a_tunnel_at_another_port_and_by_a_link(tuner: Served) -> None:
    tunnel = {"host": "localhost:9999", "origin": "http://localhost:9999", "sec-fetch-site": "same-origin"}
    assert httpx.post(f"{tuner.address}api/sessions", json={}, headers=tunnel).status_code == 200
    visit = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    assert httpx.get(tuner.address, headers=visit).status_code == 200
    assert httpx.get(f"{tuner.address}static/main.js", headers=visit).status_code == 403


def test_pages_that_were_left_make_room_for_others(client: Client, tuner: Served) -> None:
    """Recordings opened in quick succession: the page that listens stays."""
    until = time.monotonic() + 240
    while tuner.state.sessions[client.opening["session"]].listeners == 0 and time.monotonic() < until:
        time.sleep(0.01)
    for _ in range(SESSIONS_MOST + 4):
        answer = httpx.post(f"{tuner.address}api/sessions", json={}, timeout=240)
        assert answer.status_code == 200, answer.text
    assert len(tuner.state.sessions) <= SESSIONS_MOST
    assert {client.opening["session"], answer.json()["session"]} <= tuner.state.sessions.keys()
    for session in list(tuner.state.sessions.values()):
        if session.listeners == 0:
            tuner.state.close_session(session)
            session.join(10)


@pytest.mark.parametrize("name", ["../README.md", "/etc/passwd", "nothing.h5", "..", "", "a/../flight_back.h5x"])
def test_nothing_outside_the_folder_is_opened(tuner: Served, name: str) -> None:
    answer = httpx.post(f"{tuner.address}api/sessions", json={"recording": name})
    assert answer.status_code == 400 and "in the opened folder" in answer.json()["error"]


def test_the_page_fetches_nothing_from_elsewhere(client: Client, tuner: Served) -> None:
    http = client.http
    index = http.get(tuner.address)
    assert index.status_code == 200
    policy = index.headers["content-security-policy"]
    assert "default-src 'self'" in policy and "http" not in policy
    static = Path(__file__).parents[3] / "app/web/static"
    for path in (path for path in static.rglob("*") if path.is_file()):
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")
        assert "http://" not in text and "https://" not in text, path
        assert http.get(f"{tuner.address}static/{path.relative_to(static).as_posix()}").status_code == 200


def test_the_viewer_is_served_with_its_class_and_its_program(tuner: Served) -> None:
    version = httpx.post(f"{tuner.address}api/sessions", json={}).json()["viewer_version"]
    script = httpx.get(f"{tuner.address}rerun/{version}/widget.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert script.text.rstrip().endswith("export { WebViewer, setFrames };")
    with httpx.stream("GET", f"{tuner.address}rerun/{version}/re_viewer_bg.wasm") as program:
        assert program.headers["content-type"] == "application/wasm"
        assert next(program.iter_raw())[:4] == b"\0asm"


def test_a_stage_that_raises_says_so_and_the_last_good_state_stays(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = client.run()

    def broken(*_: Any) -> None:
        raise ValueError("out of order")

    with monkeypatch.context() as patch:
        patch.setitem(STAGES._entries, "logo", dataclasses.replace(STAGES["logo"], step=broken))
        bad = client.run({"logo": {"pad_px": 7.75}})
    assert bad["state"] == "failed"
    assert bad["error"] == "the server failed: ValueError: out of order"
    assert client.http.get(client.path(f"pictures/{good['picture']['id']}")).status_code == 200
    assert client.run({"logo": {"pad_px": 7.75}})["state"] == "done"


def test_presets_go_out_as_toml_and_come_back(client: Client) -> None:
    settings = {"logo": {"pad_px": 4.5}, "flow": {"t_acc_from": "fixed", "t_acc_us": 1800}}
    written = client.post("presets/write", parameters=settings).json()
    read = client.post("presets/read", text=written["toml"]).json()["parameters"]
    assert read == Parameters().with_values(settings).as_dict()
    for text in ("[logo\npad_px = 1", "[logo]\npad_px = 1e9", "[nothing]\na = 1", "logo = 3"):
        answer = client.post("presets/read", text=text)
        assert answer.status_code == 400 and answer.json()["error"]
    old = client.post("presets/read", text="[contrast]\nweakest = 0.3\n").json()
    assert old["parameters"]["contrast"]["min_gain"] == 0.3
    assert old["notices"] == ["contrast.weakest is now called contrast.min_gain"]
    assert client.opening["renamed"]["contrast.weakest"] == "contrast.min_gain"
    assert client.post("presets/read", text="#" * 200_000).status_code in (413, 422)


def test_the_paper_preset_leaves_the_set_up_alone(client: Client) -> None:
    paper = client.opening["presets"]["paper"]
    opened_with = client.opening["presets"]["opened"]
    assert paper["camera"] == opened_with["camera"] and paper["track"]["ball"] == opened_with["track"]["ball"]
    assert paper["filter"]["logo_mode"] == "stc_cut_trail"


def test_the_command_line_gives_the_same_numbers(client: Client) -> None:
    done = client.run({"logo": {"pad_px": 4.0}})
    assert done["state"] == "done"
    mine = client.http.get(client.path("export/results.json")).json()
    command = client.post("presets/write", parameters={"logo": {"pad_px": 4.0}}).json()["command"]
    words = shlex.split(command)
    assert words[:2] == ["spinscope", "analyze"]
    answer = CliRunner().invoke(cli, [*words[1:], "--json", "-"])
    theirs = json.loads(answer.stdout)
    assert theirs["shots"] == mine["shots"]
    assert theirs["parameters"] == mine["parameters"]


def test_a_preview_comes_before_the_picture_and_at_any_time_after(client: Client) -> None:
    client.run({"logo": {"pad_px": 3.0}}, playhead_us=40_000.0, interactive=True)
    pictured = [message["kind"] for message in client.messages if message.get("picture")]
    assert pictured[0] == "preview" and "run" in pictured
    shown = next(message for message in client.messages if message["kind"] == "preview")
    assert 40_000 <= shown["t_us"] < 40_000 + 2 * 5000 and "rps so far" in shown["words"]
    assert shown["picture"].startswith("data:image/png;base64,")
    later = client.http.get(client.path("preview?t_us=60000.5")).json()
    assert later["t_us"] <= 60_000 < later["t_us"] + 2 * 5000 and later["picture"] != shown["picture"]
    assert (
        client.http.get(client.path("preview?t_us=-1e9")).json()["t_us"]
        <= 5000 + client.opening["recording"]["start_us"]
    )


def test_results_go_out_as_tables_and_as_a_recording(client: Client, tmp_path: Path) -> None:
    assert client.http.get(client.path("export/results.json")).status_code == 409
    client.run()
    spins = list(csv.DictReader(io.StringIO(client.http.get(client.path("export/spins.csv")).text)))
    assert {row["method"] for row in spins} >= {"triplet", "normal_flow"}
    series = list(csv.DictReader(io.StringIO(client.http.get(client.path("export/series.csv")).text)))
    assert len(series) > 10 and float(series[0]["radius_px"]) > 5 and float(series[-1]["contrast_magnitude_rps"]) > 1
    columns = parquet.read_table(io.BytesIO(client.http.get(client.path("export/series.parquet")).content))
    assert columns.column("radius_px").to_pylist() == [float(row["radius_px"]) for row in series]
    assert client.http.get(client.path("export/series.pdf")).content.startswith(b"%PDF")
    answer = client.http.get(client.path("export/run.rrd"))
    assert 'filename="flight_fast_top.rrd"' in answer.headers["content-disposition"]
    path = tmp_path / "run.rrd"
    path.write_bytes(answer.content)
    assert {chunk.entity_path for chunk in RrdReader(path).stream()} >= {"/image/events"}
    assert client.http.get(client.path("export/nothing")).status_code == 404


def test_pictures_of_a_view_become_a_video(tuner: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    def sent(content: bytes) -> httpx.Response:
        headers = {"content-type": "application/octet-stream"}
        return httpx.post(f"{tuner.address}api/video", content=content, headers=headers, timeout=240)

    pictures = [cv2.imencode(".jpg", np.full((31, 45, 3), level, np.uint8))[1].tobytes() for level in (0, 128, 255)]
    answer = sent(b"".join(pictures))
    assert answer.headers["content-type"] == "video/mp4" and answer.content[4:8] == b"ftyp"
    refused = sent(b"no picture at all")
    assert refused.status_code == 400 and "the video cannot be written" in refused.json()["error"]
    monkeypatch.setattr(video_routes, "VIDEO_BYTES", 100)
    assert sent(b"".join(pictures)).status_code == 413


def test_a_fixed_ball_is_found_and_its_picture_shown(tuner: Served) -> None:
    client = tuner.open("spinner_ball2_side.h5")
    start_us, end_us = client.opening["recording"]["clip_us"]
    picture = client.http.get(client.path(f"events.png?start_us={start_us}&end_us={end_us}"))
    assert picture.content.startswith(b"\x89PNG")
    found = client.post("find_ball", parameters={}).json()
    # Where the ball is: the samples' README.
    assert abs(found["fixed_x_px"] - 528.43) < 3 and abs(found["fixed_y_px"] - 426.87) < 3
    done = client.run({"track": {"ball": "fixed", **found}})
    assert done["metrics"]["shots"]


def test_a_long_recording_is_worked_on_clip_by_clip(flight: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.app.web.open_recording.CLIP_FRAMES_BYTES", 10 * 1280 * 720)
    recording = OpenRecording.open(flight, Choices())
    assert recording.is_long
    start_us, end_us = recording.first_clip_us()
    assert end_us - start_us <= recording.longest_us == 50_000
    for share in recording.find_shots(recording.session.parameters):
        last = share
    assert last == 1.0
    assert len(recording.found_us) == 1
    found_start_us, found_end_us = recording.found_us[0]
    assert found_end_us - found_start_us > 80_000
    clip = recording.clip(start_us, end_us)
    ticks = list(clip.chain.run(recording.session.parameters))
    assert ticks[0].packet.start_us <= start_us and ticks[-1].packet.end_us == end_us


@pytest.mark.parametrize(("tools", "is_long"), [(True, True), (False, False)])
def test_without_tools_more_is_shown_at_once(
    flight: Path, monkeypatch: pytest.MonkeyPatch, tools: bool, is_long: bool
) -> None:
    monkeypatch.setattr("spinscope.app.web.open_recording.CLIP_FRAMES_BYTES", 10 * 1280 * 720)
    state = AppState(flight, Choices(), tools=tools)
    try:
        recording = state.recording()
        assert recording.is_long is is_long
        clip = recording.first_clip()
        clip.chain.check(clip.parameters, recording.max_frame_bytes)
    finally:
        state.close()
