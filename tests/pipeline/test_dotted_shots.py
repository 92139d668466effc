"""Dotted balls as truth: their mean at a setting, its spread, and the ways their tables are written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.dotted_shots import DottedShots
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.sidecar import Sidecar
from tests.track_runs import disc_events

FULL_TURN = 2 * math.pi


def written(folder: Path, text: str) -> Path:
    (folder / "spindoe.csv").write_text(text)
    return folder / "spindoe.csv"


@pytest.mark.parametrize(
    "text",
    [
        f"traj_file,x_spin,y_spin,z_spin\n0,{FULL_TURN * 30},0,0\n1,{FULL_TURN * 50},0,0\n",
        "t_us,spin_x_rps,spin_y_rps,spin_z_rps\n12,30,0,0\n900,50,0,0\n",
        "setting;spin_x_rps;spin_y_rps;spin_z_rps\ntop;30,0;0;0\nside;0;0;9\ntop;50,0;0;0\n",
        "shot,t_us,spin_x_rps,spin_y_rps,spin_z_rps\n1,0,29,0,0\n1,9,31,0,0\n2,0,50,0,0\n",
    ],
)
def test_tables_are_written_in_several_ways(tmp_path: Path, text: str) -> None:
    assert DottedShots.read(written(tmp_path, text), "top").spins_rps == pytest.approx(
        np.array([[30, 0, 0], [50, 0, 0]])
    )


def test_stated_errors_are_those_of_another_shot_about_the_mean() -> None:
    random = np.random.default_rng(76_011)
    off_rps, off_deg, stated_rps, stated_deg = [], [], [], []
    for _ in range(3000):
        *dotted, with_logo = np.array([60.0, 0.0, 0.0]) + 3.0 * random.standard_normal((6, 3))
        shots = DottedShots(np.array(dotted))
        mean = shots.mean_rps
        off_rps.append(np.linalg.norm(with_logo) - np.linalg.norm(mean))
        cosine = with_logo @ mean / np.linalg.norm(with_logo) / np.linalg.norm(mean)
        off_deg.append(math.degrees(math.acos(min(cosine, 1.0))))
        stated_rps.append(math.sqrt(shots.magnitude_std_rps**2 - (0.01 * 60.0) ** 2))
        assert shots.axis_std_deg is not None
        stated_deg.append(math.sqrt(shots.axis_std_deg**2 - 2.4**2))
    assert np.std(off_rps) == pytest.approx(math.sqrt(np.mean(np.square(stated_rps))), rel=0.05)
    assert math.sqrt(np.mean(np.square(off_deg))) == pytest.approx(math.sqrt(np.mean(np.square(stated_deg))), rel=0.05)


def test_a_single_shot_has_the_error_of_spindoe() -> None:
    one = DottedShots(np.array([[0.0, 40.0, 0.0]]))
    assert one.magnitude_std_rps == pytest.approx(0.4) and one.axis_std_deg == pytest.approx(2.4)
    assert DottedShots(np.zeros((2, 3))).axis_std_deg is None


def test_a_sidecar_names_the_table(tmp_path: Path) -> None:
    written(tmp_path, "setting,spin_x_rps,spin_y_rps,spin_z_rps\ntop,30,0,0\ntop,50,0,0\n")
    (tmp_path / "shot.toml").write_text('[truth]\nsetting = "top"\ndotted_shots = "spindoe.csv"\nball = 2\n')
    truth = Sidecar.beside(tmp_path / "shot.raw").truth
    assert (
        truth is not None
        and truth.spin_rps == pytest.approx((40, 0, 0))
        and (truth.rps, truth.dotted_shots, truth.ball) == (40, 2, 2)
    )
    assert truth.spin_std_rps == pytest.approx(math.hypot(math.sqrt(200 * 1.5), 0.4))
    (tmp_path / "shot.toml").unlink()
    (tmp_path / "truth.csv").write_text("recording,setting,dotted_shots,ball\nshot,top,spindoe.csv,2\n")
    assert Sidecar.beside(tmp_path / "shot.raw").truth == truth


def with_trajectories(folder: Path) -> Path:
    """A folder as SpinDOE's data set has it: shots 0, 1 and 12, of 6, 8 and 10 m/s along y, that gravity bends."""
    made = folder / "trajectories"
    made.mkdir()
    (made / "index.csv").write_text(
        "traj_file,x_spin,y_spin,z_spin\n"
        + "".join(f"{number},{FULL_TURN * rps},0,0\n" for number, rps in ((0, 30), (1, 50), (12, 70)))
    )
    t_s = np.array([0.0, 0.007, 0.014, 0.014, 0.05, 0.08, 0.2])  # as there, one time twice
    for number, speed_m_s in ((0, 6.0), (1, 8.0), (12, 10.0)):
        lines = [f"{t:.3f};0.006;{1 - speed_m_s * t:.4f};{0.3 - 4.905 * t**2:.4f}" for t in t_s]
        (made / f"{number:03}.csv").write_text("\n".join(lines) + "\n")
    return made


def test_trajectories_of_spindoe_are_read_by_number_and_tell_the_speed(tmp_path: Path) -> None:
    made = with_trajectories(tmp_path)
    every = DottedShots.read(made, "top")
    assert every.mean_rps == pytest.approx([50, 0, 0]) and every.speed_m_s == pytest.approx(8.0, rel=0.01)
    (tmp_path / "shot.toml").write_text('[truth]\ndotted_shots = "trajectories"\ndotted_trajectories = [0, 1]\n')
    truth = Sidecar.beside(tmp_path / "shot.raw").truth
    assert truth is not None and truth.rps == pytest.approx(40) and truth.dotted_shots == 2
    assert truth.speed_m_s == pytest.approx(7.0, rel=0.01)
    (tmp_path / "shot.toml").unlink()
    heading = "recording,dotted_shots,dotted_trajectories,speed_m_s"
    (tmp_path / "truth.csv").write_text(f"{heading}\nshot,trajectories,1 12,9\nother,trajectories,12,\n")
    shot, other = (Sidecar.beside(tmp_path / f"{name}.raw").truth for name in ("shot", "other"))
    assert shot is not None and shot.rps == pytest.approx(60) and shot.speed_m_s == 9.0
    assert other is not None and other.rps == pytest.approx(70) and other.speed_m_s == pytest.approx(10.0, rel=0.01)
    write_recording(
        tmp_path / "shot.csv",
        disc_events(np.array([9.0, 9, 900, 0, 5]), 0, 9000, width_px=32, height_px=32),
        width_px=32,
        height_px=32,
    )
    assert recordings_in([tmp_path]) == [tmp_path / "shot.csv"]
    (made / "012.csv").unlink()  # the spin is in the index alone
    other = Sidecar.beside(tmp_path / "other.raw").truth
    assert other is not None and other.rps == pytest.approx(70) and other.speed_m_s is None


@pytest.mark.parametrize(
    ("stated", "trajectory", "words"),
    [
        ('dotted_shots = "trajectories"\ndotted_trajectories = [2]', "", "no row of the setting has traj_file 2"),
        ('dotted_shots = "trajectories"\ndotted_trajectories = [0.5]', "", "give whole numbers"),
        ("rps = 3\ndotted_trajectories = [0]", "", "are numbers of dotted_shots"),
        ('dotted_shots = "trajectories"', "t;x;y;z\n0;1;2;3\n", "lines time;x;y;z.*000.csv"),
        ('dotted_shots = "trajectories"', "0;1;2;3\n0;1;2;3\n", "in order of time"),
    ],
)
def test_wrong_trajectories_are_refused_in_words(tmp_path: Path, stated: str, trajectory: str, words: str) -> None:
    made = with_trajectories(tmp_path)
    (tmp_path / "shot.toml").write_text(f"[truth]\n{stated}\n")
    if trajectory:
        (made / "000.csv").write_text(trajectory)
    with pytest.raises(ParameterError, match=words):
        Sidecar.beside(tmp_path / "shot.raw")


@pytest.mark.parametrize(
    ("sidecar", "table", "words"),
    [
        (
            'setting = "back"',
            "setting,x_spin,y_spin,z_spin\ntop,1,2,3\n",
            "no dotted shot is of the setting 'back'.*top",
        ),
        ("", "t,x,y,z\n0,1,2,3\n", "no spin in columns t, x, y, z: give x_spin"),
        ("", "x_spin,y_spin,z_spin\n1,2,many\n", "shot 1 of the setting has no numbers"),
        ("", "x_spin,y_spin,z_spin\n", "no row"),
        ("rps = 3", "x_spin,y_spin,z_spin\n1,2,3\n", "give one of them"),
    ],
)
def test_wrong_tables_are_refused_in_words(tmp_path: Path, sidecar: str, table: str, words: str) -> None:
    written(tmp_path, table)
    (tmp_path / "shot.toml").write_text(f'[truth]\ndotted_shots = "spindoe.csv"\n{sidecar}\n')
    with pytest.raises(ParameterError, match=words):
        Sidecar.beside(tmp_path / "shot.raw")
    (tmp_path / "spindoe.csv").unlink()
    if not sidecar:
        with pytest.raises(RecordingError, match="cannot be read"):
            Sidecar.beside(tmp_path / "shot.raw")
