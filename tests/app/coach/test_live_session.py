"""Shots of a running camera in a coach's session."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, get_args

import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.coach.session import ShotSession
from spinscope.app.coach.texts import texts
from spinscope.app.web.coach_application import CoachState
from spinscope.pipeline.cameras import NoticeKind
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.session import Session


def end_us(row: dict[str, Any]) -> int:
    return int(row["end_us"])


def test_shots_stand_in_the_session_before_they_are_analyzed_again_and_keep_their_names(
    tmp_path: Path, samples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, asked = samples / "own/bounce.h5", list[Any]()

    def serve(state: CoachState, port: int, **page: Any) -> None:
        session = next(iter(state.sessions.values()))
        while state.camera_notice() is None:  # until the replay has ended
            time.sleep(0.01)
        first = sorted(session.shots(), key=end_us)
        session.name_shots([first[0]["id"]], {"player": "A"})
        (analysis,) = state._analyses
        analysis.run_once()
        asked.append((session, first, sorted(session.shots(), key=end_us), state.camera_notice(), page))

    monkeypatch.setattr("spinscope.app.live.coach_page.serve_coach", serve)
    options = ["--replay", str(recording), "--speed", "inf", "--session", str(tmp_path / "day"), "--port", "0"]
    done = CliRunner().invoke(cli, ["coach", "live", *options, "--no-browser"])
    assert done.exit_code == 0, done.output
    ((session, first, analyzed, notice, page),) = asked
    assert notice.kind == "ended" and page["place"] == "live"
    kinds = (*get_args(NoticeKind), "ended")
    assert {
        language: [kind for kind in kinds if f"camera_{kind}" not in words] for language, words in texts().items()
    } == {
        "en": [],
        "de": [],
    }
    truth = Session.open(recording).estimate().shots
    assert [one["end_us"] for one in first] == [shot.end_us for shot in truth]
    assert [one["spin_rps"] for one in first] == [
        shot.estimates[shot.best].magnitude_rps for shot in truth if shot.best
    ]
    assert all(one["picture_file"] is None for one in first)
    assert [one["id"] for one in analyzed] == [one["id"] for one in first] and analyzed[0]["player"] == "A"
    assert all((session.folder / one["picture_file"]).is_file() for one in analyzed)
    assert abs(analyzed[0]["end_us"] - analyzed[1]["start_us"]) < 2000 and analyzed[1]["began_by"] == "bounce"
    for before, after in zip(first, analyzed, strict=True):
        assert after["spin_rps"] == pytest.approx(before["spin_rps"], rel=0.02)
        assert after["recorded_s"] == pytest.approx(before["recorded_s"], abs=60.0)


def test_a_camera_that_cannot_be_opened_is_an_error_and_no_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spinscope.app.live.coach_page.serve_coach", lambda *_, **__: pytest.fail("no camera"))
    options = ["--replay", str(tmp_path / "no.raw"), "--session", str(tmp_path / "day")]
    done = CliRunner().invoke(cli, ["coach", "live", *options])
    assert isinstance(done.exception, RecordingError) and "no.raw" in str(done.exception)
    assert not ShotSession(tmp_path / "day").shots()
