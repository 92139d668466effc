"""Sessions: names outlive analyses, other versions open, interruptions and damaged recordings stop nothing."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from spinscope.app.coach import session_analysis
from spinscope.app.coach.session import NOT_FOUND, TABLE_FILE, ShotSession
from spinscope.app.coach.session_analysis import SessionAnalysis
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.evaluation.workers import local_workers
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.session import Choices

from .session_shots import KNOWN, analysis, shot


@pytest.fixture
def session(tmp_path: Path) -> ShotSession:
    return ShotSession(tmp_path / "session")


def test_names_and_marks_pass_to_the_shots_at_the_same_time(session: ShotSession) -> None:
    first, second = session.add("day.raw", KNOWN, analysis(shot(1), shot(2, 200_000, 300_000)))
    session.name_shots([second], {"player": " Ma  Long ", "marked": True})
    again = analysis(shot(1, 190_000, 305_000, spin_rps=61.0), shot(2, 500_000, 600_000))
    session.add("day.raw", KNOWN, again)
    rows = {row["id"]: row for row in session.shots()}
    assert (rows[second]["player"], rows[second]["marked"], rows[second]["spin_rps"]) == ("Ma Long", 1, 61.0)
    assert rows[first]["deleted"] == 1  # nobody had named it
    assert len(rows) == 3 and session.shot(second)["shot"] == 1


def test_a_named_shot_that_is_not_found_again_stays_without_a_spin(session: ShotSession) -> None:
    (only,) = session.add("day.raw", KNOWN, analysis(shot()))
    session.name_shots([only], {"drill": "serves"})
    session.add("day.raw", KNOWN, analysis(reason="no ball"))
    row = session.shot(only)
    assert (row["drill"], row["spin_rps"], row["reason"], row["deleted"]) == ("serves", None, NOT_FOUND, 0)


def test_a_failed_analysis_leaves_the_shots_as_they_were(session: ShotSession) -> None:
    session.add("day.raw", KNOWN, analysis(shot()))
    session.add("day.raw", KNOWN, None)
    assert [row["spin_rps"] for row in session.shots()] == [50.0]


def test_only_what_changed_is_given_since_a_revision(session: ShotSession) -> None:
    ids = session.add("day.raw", KNOWN, analysis(shot(1), shot(2, 200_000, 300_000)))
    revision = session.revision
    session.name_shots(ids[:1], {"deleted": True})
    assert [row["id"] for row in session.shots(since=revision)] == ids[:1]
    assert session.shots(since=session.revision) == []


def test_new_shots_get_the_names_of_who_plays_now(session: ShotSession) -> None:
    session.keep_setting("now", {"player": "A", "drill": "serves"})
    session.add("day.raw", KNOWN, analysis(shot()))
    assert [(row["player"], row["drill"], row["wing"]) for row in session.shots()] == [("A", "serves", None)]


@pytest.mark.parametrize("values", [{"spin_rps": "90"}, {"player": "x" * 81}, {"marked": "yes"}, {"id; DROP": "x"}])
def test_nothing_but_names_and_marks_is_set(session: ShotSession, values: dict[str, str]) -> None:
    ids = session.add("day.raw", KNOWN, analysis(shot()))
    before = session.shots()
    with pytest.raises(ParameterError):
        session.name_shots(ids, values)
    assert session.shots() == before


def test_sessions_of_older_and_newer_versions_open(session: ShotSession) -> None:
    session.add("day.raw", KNOWN, analysis(shot()))
    table = sqlite3.connect(session.folder / TABLE_FILE)
    with table:
        table.execute("ALTER TABLE shots DROP COLUMN told_by")  # an older version has not known it
        table.execute("ALTER TABLE shots ADD COLUMN racket TEXT DEFAULT 'red'")  # a newer version knows more
    table.close()
    reopened = ShotSession(session.folder)
    (row,) = reopened.shots()
    assert row["spin_rps"] == 50.0 and row["told_by"] is None and "racket" not in row
    reopened.name_shots([row["id"]], {"player": "B"})
    table = sqlite3.connect(session.folder / TABLE_FILE)
    assert table.execute("SELECT racket, player FROM shots").fetchall() == [("red", "B")]
    table.close()


def test_a_file_that_is_no_table_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / TABLE_FILE).write_bytes(b"no database at all" * 100)
    with pytest.raises(RecordingError, match="not a database"):
        ShotSession(tmp_path)


WRITER = """
import itertools, sys
from pathlib import Path
from spinscope.app.coach.session import ShotSession
from tests.app.coach.session_shots import KNOWN, analysis, shot
session = ShotSession(Path(sys.argv[1]))
for number in itertools.count():
    session.add(f"{number}.raw", KNOWN, analysis(shot(1, recording=f"{number}.raw"), shot(2, 200_000, 300_000)))
    print(number, flush=True)
"""


def test_a_killed_program_leaves_whole_analyses(tmp_path: Path) -> None:
    root = Path(__file__).parents[3]
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path)], cwd=root, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "0\n"
    time.sleep(0.2)  # killed at any moment of what follows
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    session = ShotSession(tmp_path)
    assert len(session.shots()) == 2 * len(session.recordings()) >= 2


def test_recordings_are_analyzed_once_and_damaged_ones_are_listed(session: ShotSession, samples: Path) -> None:
    folder = session.folder.parent / "recordings"
    folder.mkdir()
    shutil.copy(samples / "own/bounce.h5", folder / "bounce.h5")
    (folder / "damaged.h5").write_bytes((samples / "flight_back.h5").read_bytes()[:5000])
    told: list[int] = []
    work = SessionAnalysis(session, [folder], Choices(), jobs=1, on_change=lambda: told.append(work.progress.done))
    work.run_once()
    before, after = session.shots()
    assert (before["ended_by"], after["began_by"]) == ("bounce", "bounce") and told[-1] == 2
    assert before["spin_rps"] == pytest.approx(33.8, abs=0.3) and after["spin_rps"] == pytest.approx(44.4, abs=0.3)
    assert before["topspin_rps"] > 33 and before["told_by"] == "logo"
    listed = session.recordings()
    assert listed[str(folder / "damaged.h5")]["error"] and listed[str(folder / "bounce.h5")]["error"] is None
    # What the view draws.
    detail = session.shot(before["id"])["detail"]
    proof = {name: np.array(detail["proof"][name]) for name in ("first", "second", "turned")}
    distances = np.linalg.norm(proof["turned"][:, None] - proof["second"][None], axis=2).min(axis=1)
    untouched = np.linalg.norm(proof["first"][:, None] - proof["second"][None], axis=2).min(axis=1)
    assert np.median(distances) < 0.1 < np.median(untouched)
    assert detail["texture"] and len(detail["path"]["t_us"]) == len(detail["path"]["z_m"]) > 5
    # The small recording holds the shot's events and reads like any other.
    kept = open_recording(session.folder / before["events_file"])
    assert kept.width_px == 1280 and 5000 < len(kept.read()) < 80_000
    assert (session.folder / before["picture_file"]).stat().st_size > 1000
    # A later session of work has nothing to do but the damaged one, which may have been mended.
    later = SessionAnalysis(ShotSession(session.folder), [folder], Choices(), jobs=1)
    assert [path.name for path, _ in later._pending()] == ["damaged.h5"]
    other = SessionAnalysis(session, [folder], Choices(assignments=("logo.pad_px=3",)), jobs=1)
    assert len(list(other._pending())) == 2


@pytest.mark.parametrize(("most_wait_s", "asked"), [(1e9, 4), (0.0015, 3)])
def test_the_analysis_waits_while_a_shot_is_played_but_not_for_ever(
    session: ShotSession, monkeypatch: pytest.MonkeyPatch, most_wait_s: float, asked: int
) -> None:
    monkeypatch.setattr(session_analysis, "POLL_S", 0.001)
    monkeypatch.setattr(session_analysis, "MOST_WAIT_S", most_wait_s)
    monkeypatch.setattr(session_analysis, "load_stages", lambda: None)
    calls = list[str]()

    def is_playing() -> bool:
        calls.append("asked")
        return len(calls) < 4

    waiting = SessionAnalysis(session, [], Choices(), is_playing=is_playing)
    worked = threading.Event()

    def work() -> None:
        calls.append("work")
        waiting._ended.set_result(None)
        worked.set()

    monkeypatch.setattr(waiting, "run_once", work)
    waiting.start()
    assert worked.wait(240.0)
    waiting.close()
    assert calls[: calls.index("work")] == ["asked"] * asked


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # NumPy's threads end before a copy is made
def test_closing_ends_the_processes_of_the_analysis_alone(session: ShotSession, samples: Path) -> None:
    paths = [samples / "own/bounce.h5", samples / "flight_back.h5"]
    with local_workers(1) as others:
        other = others.executor.submit(os.getpid).result()
        before = multiprocessing.active_children()
        work = SessionAnalysis(session, paths, Choices(), jobs=2)
        work.start()
        while len(multiprocessing.active_children()) < len(before) + 2:
            work._thread.join(0.01)
            assert work._thread.is_alive()
        work.close()
        assert not work._thread.is_alive()
        assert set(multiprocessing.active_children()) == set(before)
        assert others.executor.submit(os.getpid).result() == other
