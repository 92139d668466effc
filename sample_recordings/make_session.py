"""Make the sample session of the coach's page anew: `uv run python sample_recordings/make_session.py [FOLDER]`.

Two players, three days, 30 shots, simulated before a camera that looks down on the table beyond the net, and then
analyzed like any recordings. The small recordings of the events are kept of the first KEPT shots only: the whole folder
stays below 3 MB.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from spinscope.app.coach.session import TABLE_FILE, ShotSession
from spinscope.app.coach.session_analysis import SessionAnalysis
from spinscope.app.terminal import note
from spinscope.pipeline.session import Choices
from spinscope.pipeline.simulated_recordings import simulate_to_file

FOLDER = Path(__file__).parent / "session"
SENSOR = {"width_px": 1024, "height_px": 480}
SEED = 1700
DAYS = (
    datetime(2026, 10, 5, 17, tzinfo=UTC),
    datetime(2026, 10, 19, 17, tzinfo=UTC),
    datetime(2026, 11, 2, 17, tzinfo=UTC),
)
KEPT = 3
# Where the camera is: rows of the table's axes (along it, to the left, up) in the camera frame, and the camera's place
# in the table's frame, whose origin is the middle of the net's line on the table.
POSE = {"axes": [[1, 0, 0], [0, -1, 0], [0, 0, -1]], "camera_m": [0.45, 0.0, 2.0]}


@dataclass(frozen=True)
class SampleShot:
    """A shot of the session: who, what, and its spin as the hitter sees it.

    Attributes
    ----------
    spin_rps : (3,) tuple of float
        Topspin, left sidespin, right corkscrew.
    ball : int, optional
        How the logo sits (1 to 7); 5 = on the axis, hardly seen.
    bounces : bool
        Whether it bounces before the camera, which makes two shots of it.
    """

    player: str
    day: int
    wing: str
    stroke: str
    drill: str
    spin_rps: tuple[float, float, float]
    speed_m_s: float
    ball: int = 1
    bounces: bool = False

    @property
    def camera_spin_rps(self) -> tuple[float, float, float]:
        """The spin in the frame of a camera that looks down, for a flight along +x."""
        topspin, sidespin, corkscrew = self.spin_rps
        return corkscrew, -topspin, -sidespin


def shots() -> list[SampleShot]:
    """The shots in the order of time."""
    made = []
    maximum = ("forehand", "topspin", "maximum topspin")
    for day, spins in enumerate(((66, 71, 62, 69), (72, 77, 70, 75), (83, 79, 86, 81))):  # A gets better
        made += [SampleShot("A", day, *maximum, (spin, 6 - spin / 5, 4), 11 + spin / 20) for spin in spins]
    for day, spins in enumerate(((58, 66, 51), (55, 61, 68), (60, 52, 65))):  # B does not
        made += [SampleShot("B", day, *maximum, (spin, 12, -6), 12.0, ball=1 + day) for spin in spins]
    push, serve = ("backhand", "push", "backspin rally"), ("forehand", "serve", "serves")
    made += [
        SampleShot("A", 0, *push, (-34, 3, 2), 5.0),
        SampleShot("B", 1, *push, (-45, 2, 3), 5.5),
        SampleShot("B", 2, *push, (-9, 24, 38), 4.8, ball=5),
        SampleShot("A", 1, *serve, (-22, 38, 8), 6.0, ball=2),
        SampleShot("A", 2, *serve, (16, -41, 10), 6.2, ball=2, bounces=True),
        SampleShot("B", 2, *serve, (-30, 12, 33), 6.0),
        SampleShot("B", 0, *serve, (-3, 2, 1), 5.5),
        SampleShot("B", 1, "forehand", "smash", "", (14, 4, 0), 19.0),
    ]
    return sorted(made, key=lambda shot: shot.day)


def make(folder: Path) -> None:
    """Make the session in a folder, which is replaced."""
    shutil.rmtree(folder, ignore_errors=True)
    session, wanted = ShotSession(folder), {}
    with TemporaryDirectory() as place:
        for number, shot in enumerate(shots()):
            path = Path(place) / f"{number + 1:02d}_{shot.player}.h5"
            options = {
                "spin_rps": shot.camera_spin_rps,
                "speed_m_s": shot.speed_m_s,
                "ball": shot.ball,
                "bounce": shot.bounces,
            }
            simulate_to_file("flight", path, heading_deg=0.0, seed=SEED + number, **SENSOR, **options)
            at_s = DAYS[shot.day].timestamp() + 40 * number
            os.utime(path, (at_s, at_s))
            wanted[str(path)] = shot
            note(f"{path.name}: {shot}")
        SessionAnalysis(session, [Path(place)], Choices()).run_once()
    for row in session.shots():
        shot = wanted[row["recording"]]
        names = {name: getattr(shot, name) for name in ("player", "wing", "stroke", "drill")}
        session.name_shots([row["id"]], names)
        if row["id"] > KEPT:
            (folder / row["events_file"]).unlink()
    session.keep_setting("pose", POSE)
    table = sqlite3.connect(folder / TABLE_FILE)
    with table:
        table.execute(f"UPDATE shots SET events_file = NULL WHERE id > {KEPT}")
        for name in ("shots", "recordings"):  # the names alone: the recordings themselves are not kept
            table.execute(f"UPDATE {name} SET recording = substr(recording, length(?) + 2)", (place,))
    table.execute("VACUUM")
    table.close()


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
