"""What is taken home: report, table, video; the texts behind them, the sample session, the command."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from pyarrow import parquet

from sample_recordings.make_session import SampleShot, shots
from spinscope.app.cli import cli
from spinscope.app.coach import video
from spinscope.app.coach.flight_path import TABLE_LENGTH_M, flight_path
from spinscope.app.coach.report import report_html, write_report
from spinscope.app.coach.session import ShotSession
from spinscope.app.coach.session_folders import SAMPLE
from spinscope.app.coach.shot_words import ShotWords
from spinscope.app.coach.texts import texts
from spinscope.app.coach.video import video_frames, write_video
from spinscope.pipeline.errors import ParameterError

STATIC = Path(__file__).parents[3] / "app/web/static/coach"


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> ShotSession:
    folder = tmp_path_factory.mktemp("coach") / "sample"
    shutil.copytree(SAMPLE, folder)
    return ShotSession(folder)


def true_shot(row: dict[str, Any]) -> SampleShot:
    """What was simulated for a row of the sample session."""
    return shots()[int(row["recording"][:2]) - 1]


def test_the_sample_session_is_small_and_right(sample: ShotSession) -> None:
    assert sum(path.stat().st_size for path in SAMPLE.rglob("*") if path.is_file()) < 3e6
    rows = sample.shots()
    assert len(rows) == 30 and {row["player"] for row in rows} == {"A", "B"}
    for row in rows:
        true = true_shot(row)
        assert row["drill"] == true.drill or not true.drill
        if row["began_by"] != "bounce":  # after a bounce it has another spin
            error = np.subtract(sample.shot(row["id"])["detail"]["spin_rps"], true.camera_spin_rps)
            limit = max(3.0, 0.09 * np.linalg.norm(true.spin_rps), 3 * row["spin_std_rps"])
            assert np.linalg.norm(error) < limit, row["id"]
            assert row["speed_m_s"] == pytest.approx(true.speed_m_s, rel=0.06)
    assert {row["told_by"] for row in rows} == {"logo", "flight"}


def test_the_texts_of_both_languages_are_the_same_ones() -> None:
    english, german = texts()["en"], texts()["de"]
    assert english.keys() == german.keys()
    for key, text in english.items():
        assert text and sorted(re.findall(r"\{\w+\}", text)) == sorted(re.findall(r"\{\w+\}", german[key])), key


def test_every_text_that_the_page_shows_is_there() -> None:
    used = set()
    for path in STATIC.glob("*.js"):
        script = path.read_text(encoding="utf-8")
        used |= set(re.findall(r'\btext\(\s*"([^"]+)"', script))
        for terms in re.findall(r'\bterm\(\s*"([^"]+)"', script):
            used |= {terms, f"about.{terms}"}
    assert len(used) > 60 and used <= texts()["en"].keys(), used - texts()["en"].keys()


@pytest.mark.parametrize(("language", "answer"), [("en", "A has the most topspin: 74 rps"), ("de", "Topspin: 74 U/s")])
def test_a_report_answers_and_needs_nothing_else(sample: ShotSession, language: Any, answer: str) -> None:
    page = report_html(sample, ShotWords(language))
    assert answer in page and page.count("data:image/png;base64,") == 30
    loaded = re.findall(r'(?:src|href)="(?!data:|#)([^"]*)"', page)
    assert not loaded and "<script" not in page


def test_names_are_text_in_a_report(sample: ShotSession, tmp_path: Path) -> None:
    shutil.copytree(sample.folder, tmp_path / "own")
    session = ShotSession(tmp_path / "own")
    session.name_shots([1], {"player": "<script>alert(1)</script>"})
    assert "<script" not in report_html(session, ShotWords())


def test_a_pdf_is_written(sample: ShotSession, tmp_path: Path) -> None:
    try:
        write_report(sample, tmp_path / "report.pdf", ShotWords("de"))
    except ParameterError as error:
        assert "Pango" in str(error) or "spinscope[report]" in str(error)
        pytest.skip(str(error))
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_missing_extra_is_named(sample: ShotSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr("importlib.import_module", missing)
    row = sample.shot(1)
    with pytest.raises(ParameterError, match=r"spinscope\[video\]"):
        write_video(row, row["detail"], tmp_path / "shot.mp4", ShotWords())
    with pytest.raises(ParameterError, match=r"spinscope\[report\]"):
        write_report(sample, tmp_path / "report.pdf", ShotWords())
    assert not list(tmp_path.iterdir())


def test_a_video_shows_the_ball_turning(sample: ShotSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "SECONDS", 0.24)
    row = sample.shot(29)
    frames = list(video_frames(row, row["detail"], ShotWords("de")))
    assert len(frames) == 6 and frames[0].shape == (video.HEIGHT_PX, video.WIDTH_PX, 3)
    assert np.mean(frames[0][:620] != frames[2][:620]) > 0.005 and np.array_equal(frames[0][640:], frames[2][640:])
    write_video(row, row["detail"], tmp_path / "shot.mp4", ShotWords("de"))
    assert (tmp_path / "shot.mp4").read_bytes()[4:8] == b"ftyp"


def test_a_shot_without_a_spin_has_no_video(sample: ShotSession, tmp_path: Path) -> None:
    row = {**sample.shot(1), "spin_rps": None, "reason": "too dark"}
    with pytest.raises(ParameterError, match="too dark"):
        write_video(row, row["detail"], tmp_path / "shot.mp4", ShotWords())


def test_the_flight_is_where_it_was(sample: ShotSession) -> None:
    pose = sample.setting("pose")
    for row in sample.shots():
        detail = sample.shot(row["id"])["detail"]
        path = flight_path(row, detail, pose)
        assert path is not None and path.frame == "table"
        points = np.array(path.points_m)
        assert points[-1, 0] > points[0, 0] and np.all(np.abs(points[:, 0]) < TABLE_LENGTH_M / 2)
        # The simulator's heights: 12 to 35 cm in the middle of a flight, a bounce on the table (2 cm, of the centre).
        assert (0.05 < np.median(points[:, 2]) < 0.45) and points[:, 2].min() > -0.02
        assert (path.landing_m is not None) == (row["ended_by"] == "bounce")
        if row["ended_by"] == "bounce":
            assert points[-1, 2] == pytest.approx(0.02, abs=2.5 * path.height_std_m)
        free = flight_path(row, detail, None)
        assert free is not None and free.frame == "hitter" and free.landing_m is None
        assert np.ptp(np.array(free.points_m)[:, 0]) == pytest.approx(np.ptp(points[:, 0]), rel=0.02)


def test_a_flight_from_the_far_end_is_turned_with_the_table() -> None:
    share = np.linspace(0, 1, 11)
    places = {"x_m": 1 - 2 * share, "y_m": 0.3 + 0.2 * share, "z_m": 0.3 + 0.4 * share * (1 - share)}
    path = {"t_us": (100_000 * share).tolist(), **{name: column.tolist() for name, column in places.items()}}
    detail = {"path": path, "hitter": np.eye(3).tolist(), "depth_std_m": 0.01, "line_of_sight": [0, 0, 1]}
    pose = {"axes": np.eye(3).tolist(), "camera_m": [0, 0, 0]}
    found = flight_path({"start_us": 0, "end_us": 100_000, "ended_by": "bounce"}, detail, pose)
    assert found is not None
    assert found.points_m[0] == pytest.approx((-1, -0.3, 0.3)) and found.points_m[-1] == pytest.approx((1, -0.5, 0.3))
    assert found.landing_m == pytest.approx((1, -0.5))
    assert found.net_clearance_m == pytest.approx(0.4 - 0.02 - 0.1525)


def test_words_have_the_chosen_units() -> None:
    assert ShotWords("en", "rpm").spin(50.0) == "3000 rpm" and ShotWords().spin(50.0) == "50 rps"
    assert ShotWords("de", speed_unit="m_s").speed(14.04) == "14,0 m/s" and ShotWords().speed(10.0) == "36 km/h"


def test_the_command_writes_report_table_and_says_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spinscope.app.coach.session_folders.user_data_path", lambda *_, **__: tmp_path / "user")
    run = CliRunner().invoke
    out = tmp_path / "report.html"
    done = run(
        cli, ["coach", "report", "--html", str(out), "--table", str(tmp_path / "shots.parquet"), "--spin-unit", "rpm"]
    )
    assert done.exit_code == 0, done.output
    assert "rpm" in out.read_text(encoding="utf-8")
    table = parquet.read_table(tmp_path / "shots.parquet").to_pylist()
    assert len(table) == 30 and table[0]["kind"] == "topspin" and 5 < table[0]["clock_hours"] < 7
    assert run(cli, ["coach", "report", str(tmp_path), "--html", str(out)]).exit_code == 2
    assert run(cli, ["coach", "nothing_of_this_name"]).exit_code == 2


def test_the_command_opens_the_sample_recordings_and_sessions(
    tmp_path: Path, samples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr("spinscope.app.coach.session_folders.user_data_path", lambda *_, **__: tmp_path)
    monkeypatch.setattr("spinscope.app.web.server.serve_coach", lambda *given, **named: asked.append((given, named)))
    for arguments in ([], ["--no-browser", "--port", "0"], [str(samples)], [str(tmp_path / "sessions/sample")]):
        assert CliRunner().invoke(cli, ["coach", *arguments]).exit_code == 0, arguments
    plain, quiet, recordings, session = asked
    assert list(plain[0][0].sessions) == ["sample"] and plain[1] == {"port": None, "open_browser": True, "hosts": ()}
    assert quiet[1] == {"port": 0, "open_browser": False, "hosts": ()}
    assert next(iter(recordings[0][0].sessions)).startswith("sample_recordings ")
    assert next(iter(session[0][0].sessions)) == "sample"
