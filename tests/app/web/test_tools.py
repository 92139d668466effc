"""Sweeps, optimization, biases: what they compute, and that they can be cancelled."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.app.tuning.bias_sweep import known_biases
from spinscope.app.tuning.optimization import REFUSED, cost_of, objection_to
from spinscope.app.tuning.parameter_sweep import scale_of, sweep_values
from spinscope.app.web.assets import STATIC
from spinscope.app.web.controls import ESSENTIALS, sections
from spinscope.pipeline.biases import BiasParameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.metrics import EstimateMetrics, RunMetrics, ShotMetrics
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Choices
from spinscope.pipeline.simulated_recordings import simulate_to_file

from .conftest import Client, served


def test_every_parameter_has_one_control() -> None:
    names = [control.name for section in sections() for control in section.controls]
    wanted = [f"{group}.{field}" for group, fields in Parameters().as_dict().items() for field in fields]
    assert sorted(names) == sorted(wanted)
    titles = [section.title for section in sections() if not section.controls[-1].is_setup]
    assert titles[:4] == ["Essentials", "Filter", "Surface (EROS)", "Cleaning"]
    assert titles[-2:] == ["Trajectory", "Combined"]


def test_the_essentials_are_open_on_top_and_say_which_stage_they_are_of() -> None:
    first, *others = sections()
    assert first.is_open and not any(section.is_open for section in others)
    assert [control.name for control in first.controls] == list(ESSENTIALS)
    assert {control.label for control in first.controls} >= {"filter threshold", "surface k", "logo pad", "track tick"}


def test_every_section_is_explained_by_entries_of_the_glossary() -> None:
    terms = set(re.findall(r"^(\S.*)\n  ", (STATIC / "glossary.md").read_text(encoding="utf-8"), re.MULTILINE))
    for section in sections():
        assert section.terms and set(section.terms) <= terms, section.title


@pytest.mark.parametrize("name", ["logo.pad_px", "filter.threshold_us", "surface.k_px", "track.coast_us"])
def test_the_values_of_a_sweep_span_the_range(name: str) -> None:
    stage, field = name.split(".")
    tunable = Parameters().group(stage).tunables()[field]
    values = sweep_values(tunable, name, None, None, 9)
    assert values[0] == tunable.low and values[-1] == pytest.approx(tunable.high)
    assert values == sorted(set(values))
    assert scale_of(tunable) in ("linear", "logarithmic", "cubic")
    for value in values:
        Parameters().with_values({stage: {field: value}})


def test_a_sweep_over_choices_takes_all_of_them_and_a_wrong_range_is_refused() -> None:
    tunable = Parameters().group("filter").tunables()["mode"]
    assert sweep_values(tunable, "filter.mode", None, None, 5) == list(tunable.choices)
    pad = Parameters().group("logo").tunables()["pad_px"]
    for low, high, points in ((3.0, 2.0, 5), (0.0, 1e9, 5), (0.0, 5.0, 1), (0.0, 5.0, 10_000)):
        with pytest.raises(ParameterError):
            sweep_values(pad, "logo.pad_px", low, high, points)


def test_a_sweep_tells_every_point_and_agrees_with_single_runs(client: Client) -> None:
    request = {"parameters": {}, "name": "logo.pad_px", "low": 2.0, "high": 6.0, "points": 3}
    assert client.post("sweep", **request).status_code == 202
    done = client.wait("sweep", lambda m: m["state"] == "done")
    assert [point["value"] for point in done["content"]["points"]] == [2.0, 4.0, 6.0]
    alone = client.run({"logo": {"pad_px": 4.0}})["metrics"]
    assert done["content"]["points"][1]["logo_events"] == alone["logo_events"]
    assert done["content"]["points"][1]["spin"] == alone["shots"][0]["spin"]


def test_a_sweep_can_be_cancelled(client: Client) -> None:
    client.post("sweep", parameters={}, name="surface.k_px", points=31)
    client.wait("sweep", lambda m: m["state"] == "running")
    assert client.post("cancel", kind="sweep").status_code == 200
    client.wait("sweep", lambda m: m["state"] == "cancelled")
    assert client.post("cancel", kind="nothing").status_code == 422


@pytest.mark.parametrize(
    "content",
    [
        {"names": []},
        {"names": ["logo.nothing"]},
        {"names": ["camera.up"]},
        {"names": ["logo.pad_px"], "objective": "luck"},
        {"names": ["logo.pad_px"], "trials": 0},
        {"names": ["logo.pad_px"], "clips_us": [[5, 1]]},
        {"names": ["track.fixed_x_px"] * 9},
    ],
)
def test_an_optimization_that_makes_no_sense_is_refused(client: Client, content: dict[str, Any]) -> None:
    request = {"parameters": {}, "names": ["logo.pad_px"], "objective": "truth", "trials": 3, **content}
    answer = client.post("optimization", **request)
    if content["names"][:1] == ["track.fixed_x_px"]:
        assert answer.status_code == 202  # one parameter named often is one parameter
        client.post("cancel", kind="optimization")
        return
    assert answer.status_code == 400 and answer.json()["error"]


def test_an_optimization_never_ends_worse_than_it_began_and_tells_the_best_so_far(client: Client) -> None:
    start = {"logo": {"pad_px": 9.0}}
    names = ["logo.pad_px", "flow.reach_px"]
    client.post("optimization", parameters=start, names=names, objective="truth", trials=6)
    done = client.wait("optimization", lambda m: m["state"] in ("done", "failed"))
    assert done["state"] == "done", done
    found = done["content"]
    allowed = [trial["cost"] for trial in found["trials"] if trial["objection"] is None]
    assert len(found["trials"]) == 6 and found["best"] == min(allowed) <= found["trials"][0]["cost"]
    assert found["clips"] == 1 and found["held_out"] is None
    values = {name.split(".")[0]: {} for name in names}
    for name, value in found["values"].items():
        stage, field = name.split(".")
        values[stage][field] = value
    shot = client.run({**start, **values})["metrics"]["shots"][0]
    assert shot["spin"][shot["best"]]["error_share"] == pytest.approx(found["best"])


def test_several_recordings_are_tuned_at_once_and_one_is_held_out(client: Client) -> None:
    names = ["flight_fast_top.h5", "flight_back.h5"]
    request = {"parameters": {}, "names": ["flow.reach_px"], "objective": "truth", "trials": 3, "recordings": names}
    assert client.post("optimization", **request).status_code == 202
    found = client.wait("optimization", lambda m: m["state"] in ("done", "failed"))["content"]
    assert found["clips"] == 1
    held = found["held_out"]
    assert held is None or (held["clips"] == 1 and held["after"] < 1)
    is_proposed = held is not None and held["objection"] is None
    assert is_proposed == (found["values"] != {"flow.reach_px": 3.0})


def test_the_pad_ranges_up_to_the_ball_that_is_seen(client: Client) -> None:
    done = client.run()
    radius_px = done["metrics"]["shots"][0]["radius_px"]
    assert radius_px - 2 <= done["highs"]["logo.pad_px"] <= radius_px


def metrics_with(best: str | None, estimate: EstimateMetrics | None) -> RunMetrics:
    shot = ShotMetrics(
        start_us=0,
        end_us=1,
        logo_events=5,
        speed_m_s=None,
        radius_px=None,
        best=best,
        best_reason=None,
        kind=None,
        sentence="",
        spin={} if estimate is None else {"triplet": estimate},
        witnesses={},
    )
    return RunMetrics(
        ticks=1,
        tracked_share=1.0,
        residual_px=0.5,
        jitter_px=None,
        logo_events=5,
        shots=[shot],
        no_shot_reason=None,
        up_doubt=None,
    )


def test_what_loses_an_answer_or_half_of_the_evidence_is_objected_to() -> None:
    estimate = EstimateMetrics(
        status="ok",
        reason=None,
        magnitude_rps=50.0,
        magnitude_std_rps=1.0,
        axis=None,
        axis_std_deg=None,
        error_rps=None,
        error_deg=None,
        error_share=None,
    )
    good = metrics_with("triplet", estimate)
    lost = metrics_with(None, dataclasses.replace(estimate, magnitude_rps=None))
    less = dataclasses.replace(good, logo_events=2)
    assert objection_to([good], [good]) is None and objection_to([good], [lost]) is None
    assert "triplet" in (objection_to([good, lost], [good, good]) or "")
    assert "2 logo events are left of 5" in (objection_to([less], [good]) or "")
    assert objection_to([None], [good]) and objection_to([None], [None])


def test_no_answer_is_the_worst_objective() -> None:
    no_shot = dataclasses.replace(metrics_with(None, None), shots=[])
    for objective in ("truth", "stated"):
        assert cost_of(no_shot, objective) == cost_of(metrics_with(None, None), objective) == REFUSED


def test_the_objectives_weigh_error_uncertainty_and_residual() -> None:
    estimate = EstimateMetrics(
        status="ok",
        reason=None,
        magnitude_rps=50.0,
        magnitude_std_rps=2.0,
        axis=[0.0, 0.0, 1.0],
        axis_std_deg=np.degrees(0.03),
        error_rps=1.0,
        error_deg=2.0,
        error_share=0.07,
    )
    metrics = metrics_with("triplet", estimate)
    assert cost_of(metrics, "truth") == 0.07
    assert cost_of(metrics, "stated") == pytest.approx(0.05 + 0.1 * 0.5)  # 2/50 and 0.03 rad together, and 0.5 px
    unknown = dataclasses.replace(estimate, error_share=None, axis_std_deg=None)
    for objective in ("truth", "stated"):
        assert cost_of(metrics_with("triplet", unknown), objective) == REFUSED


def test_biases_of_a_finished_recording_are_locked_and_say_why(client: Client) -> None:
    state = client.opening["biases"]
    assert "carries no scene" in state["locked"]
    answer = client.post("biases", biases={"diff_on": 10})
    assert answer.status_code == 400 and "carries no scene" in answer.json()["error"]


def test_a_simulated_recording_states_its_biases(simulated: Path) -> None:
    assert known_biases(simulated) == BiasParameters()


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short spinner on a small sensor, with its scene."""
    path = tmp_path_factory.mktemp("biases") / "spinner.h5"
    simulate_to_file("spinner", path, duration_ms=30.0, width_px=320, height_px=240)
    return path


def test_a_simulated_scene_is_taken_again_with_other_biases(simulated: Path) -> None:
    tuner = served(simulated)
    try:
        client = tuner.open()
        assert client.opening["biases"]["locked"] is None
        before = client.opening["recording"]["events"]
        assert client.post("biases", biases={"diff_on": 1000}).status_code == 400
        assert client.post("biases", biases={"nothing": 1}).status_code == 400
        biases = {**client.opening["biases"]["values"], "diff_on": 120, "diff_off": 150}
        assert client.post("biases", biases=biases).status_code == 202
        client.wait("biases", lambda m: m["state"] == "done")
        again = client.http.get(client.path("recording")).json()
        assert again["recording"]["events"] < 0.9 * before  # higher thresholds, fewer events
        assert again["biases"]["values"] == biases
        written = client.post("presets/write", parameters={}).json()
        assert written["needs"] == "spinscope.bias"
        assert written["command"].startswith(f"spinscope simulate again --scene {simulated} --biases spinscope.bias")
        assert written["command"].endswith("&& spinscope analyze again.h5")
        client.post("bias_sweep", biases=biases, name="diff_on", points=3)
        curve = client.wait("bias_sweep", lambda m: m["state"] in ("done", "failed"))
        assert curve["state"] == "done", curve
        noise = [point["noise_on_hz"] for point in curve["content"]["points"]]
        assert noise[0] > noise[1] > noise[2]
        client.post("bias_sweep", biases=biases, name="diff_on_off", points=2)
        both = client.wait("bias_sweep", lambda m: m["state"] == "done" and m["content"]["name"] == "diff_on_off")
        assert [point["value"] for point in both["content"]["points"]] == [
            -35,
            140,
        ]  # where both thresholds have a setting
        assert both["content"]["points"][0]["noise_off_hz"] > both["content"]["points"][1]["noise_off_hz"]
        text = client.http.post(f"{tuner.address}api/biases/write", json={"biases": biases}).json()["text"]
        read = client.http.post(f"{tuner.address}api/biases/read", json={"text": text}).json()
        assert read["biases"] == biases
        refused = client.http.post(f"{tuner.address}api/biases/read", json={"text": "x"})
        assert refused.status_code == 400
        assert "/" not in refused.json()["error"], "a file of the server's says nothing"
        # The name of what is taken again does not grow.
        client.messages.clear()
        client.post("biases", biases=client.opening["biases"]["values"])
        client.wait("biases", lambda m: m["state"] == "done")
        session = tuner.state.sessions.get(client.opening["session"])
        assert session is not None
        assert len(session.runner.recording.session.recording.path.stem) == len(simulated.stem) + 9
    finally:
        tuner.stop()


def test_recordings_with_bias_files_beside_them_give_measured_rates(
    samples: Path, tmp_path: Path, client: Client
) -> None:
    for value in (10, 60):
        (tmp_path / f"take{value}.h5").symlink_to(samples / "flight_fast_top.h5")
        (tmp_path / f"take{value}.bias").write_text(f"{value} % bias_diff_on\n0 % bias_fo\n", encoding="utf-8")
    tuner = served(tmp_path / "take10.h5")
    try:
        page = tuner.open()
        assert page.opening["biases"]["values"]["diff_on"] == 10
        page.post("bias_sweep", biases=page.opening["biases"]["values"], name="diff_on")
        done = page.wait("bias_sweep", lambda m: m["state"] in ("done", "failed"))
        assert done["state"] == "done", done
        assert [point["biases"]["diff_on"] for point in done["content"]["points"]] == [10, 60]
        assert all(point["ball_on_hz"] > 0 and point["noise_on_hz"] > 0 for point in done["content"]["points"])
    finally:
        tuner.stop()
    (tmp_path / "take10.bias").unlink()
    (tmp_path / "take60.bias").unlink()
    assert known_biases(tmp_path / "take10.h5") is None and known_biases(tmp_path / "nothing.h5") is None
    alone = served(tmp_path / "take10.h5")
    try:
        page = alone.open()
        page.post("bias_sweep", biases=page.opening["biases"]["values"], name="diff_on")
        page.wait("bias_sweep", lambda m: m["state"] == "failed")
        # A .bias file loaded in the page says what the recording was taken with.
        page.post("bias_sweep", biases={"diff_on": 25}, name="diff_on", is_known=True)
        done = page.wait("bias_sweep", lambda m: m["state"] == "done")
        assert [point["biases"]["diff_on"] for point in done["content"]["points"]] == [25]
    finally:
        alone.stop()
    client.post("bias_sweep", biases={}, name="diff_on")
    failed = client.wait("bias_sweep", lambda m: m["state"] == "failed")
    assert "no recording of this folder" in failed["error"]


def test_the_window_of_the_opened_recording_is_not_asked_of_the_folders_others(samples: Path, tmp_path: Path) -> None:
    for name in ("flight_back", "flight_fast_top"):  # 113 and 96 ms long
        (tmp_path / f"{name}.h5").symlink_to(samples / f"{name}.h5")
        (tmp_path / f"{name}.bias").write_text("10 % bias_diff_on\n", encoding="utf-8")
    (tmp_path / "take.mp4").write_bytes(b"#ROSBAG V2.0\n")
    tuner = served(tmp_path / "flight_back.h5", choices=Choices(window_us=(97_000, 113_000)))
    try:
        page = tuner.open()
        listed = [one.name for one in tuner.state.folders.listing().recordings]
        assert listed == ["flight_back.h5", "flight_fast_top.h5"]
        page.post("bias_sweep", biases={}, name="diff_on")
        done = page.wait("bias_sweep", lambda m: m["state"] == "done")
        assert [point.get("error") for point in done["content"]["points"]] == [None, None]
    finally:
        tuner.stop()
