"""`truth.csv`: statements about all recordings of a folder, under the sidecars."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from spinscope.pipeline.biases import PAPER
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.sidecar import Sidecar
from spinscope.pipeline.truth_table import TRUTH_TABLE

TRUTH = "recording,spin_rps,spin_std_rps,ball,speed_m_s,setting"
OTHERS = "x_px,y_px,radius_px,camera.focal_length_mm,bias_fo,notes"


def stated(folder: Path, text: str | bytes, recording: str) -> Sidecar:
    (folder / TRUTH_TABLE).write_bytes(text.encode() if isinstance(text, str) else text)
    return Sidecar.beside(folder / recording)


def test_a_row_states_what_a_sidecar_would(tmp_path: Path) -> None:
    row = 'wheel.raw,"[3, 4, 0]",0.1,3,7,12,640.5,360,20,16,-5,rainy\n'
    sidecar = stated(tmp_path, f"\ufeff{TRUTH},{OTHERS}\nother.raw,1 2 3,,,,,,,,,,\n{row}", "wheel.raw")
    (tmp_path / TRUTH_TABLE).unlink()
    (tmp_path / "wheel.toml").write_text(
        "[truth]\nspin_rps = [3, 4, 0]\nspin_std_rps = 0.1\nball = 3\nspeed_m_s = 7\nsetting = '12'\n"
        "[fixed_ball]\nx_px = 640.5\ny_px = 360\nradius_px = 20\n[camera]\nfocal_length_mm = 16\n[biases]\nfo = -5\n"
    )
    assert sidecar == Sidecar.beside(tmp_path / "wheel.raw") and sidecar.digest
    assert sidecar.biases == replace(PAPER, fo=-5)


@pytest.mark.parametrize(
    "text",
    [
        "recording,spin_rps\na,0 30 40\n",
        'recording,spin_rps\n./a.h5 ,"0, 30, 40"\n',
        "recording, spin_x_rps, spin_y_rps, spin_z_rps\na.h5, 0, 30, 40\n",
        "recording,axis_x,axis_y,axis_z,rps\na.h5,0,0.6,0.8,50\n",
        "recording;axis;rps\r\na.h5;0 0,6 0,8;50,0\r\n",  # a spreadsheet's with decimal commas
        "axis\trps\trecording\n0 3 4\t50\ta\n",
    ],
)
def test_vectors_and_names_are_written_in_several_ways(tmp_path: Path, text: str) -> None:
    truth = stated(tmp_path, text, "a.h5").truth
    assert truth is not None and truth.spin_rps == pytest.approx((0, 30, 40))
    assert Sidecar.beside(tmp_path / "b.h5") == Sidecar()


def test_the_table_of_the_folder_above_names_the_folder(tmp_path: Path) -> None:
    (tmp_path / "day1").mkdir()
    text = "recording,rps\nday1/a.raw,50\na.raw,40\n"
    below, above = stated(tmp_path, text, "day1/a.raw").truth, stated(tmp_path, text, "a.raw").truth
    assert below is not None and above is not None
    assert (below.rps, above.rps) == (50, 40)


def test_the_recordings_own_sidecar_goes_before_the_table(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("[truth]\nrps = 60\n[camera]\npixel_um = 5\n")
    sidecar = stated(tmp_path, "recording,rps,x_px,y_px,radius_px,camera.focal_length_mm\na,50,1,2,3,16\n", "a.raw")
    assert sidecar.truth is not None and sidecar.truth.rps == 60
    assert sidecar.fixed_ball == (1, 2, 3)
    assert sidecar.parameters == {"camera.focal_length_mm": 16.0, "camera.pixel_um": 5.0}


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("name,rps\na,3\n", ParameterError, "no column `recording`, but name, rps"),
        ("", ParameterError, "no column `recording`, but nothing"),
        ("recording,spin_rp\na,3\n", ParameterError, "spin_rp is unknown: did you mean spin_rps"),
        ("recording,rps\na,3\na.raw,4\n", ParameterError, "two rows are of a.raw"),
        ("recording,rps\na,fast\n", ParameterError, "truth.rps = 'fast'.*truth.csv"),
        ("recording,spin_x_rps,spin_y_rps\na,3,4\n", ParameterError, "three numbers"),
        ("recording,camera.focal\na,3\n", ParameterError, "camera.focal is unknown"),
        ("recording,lens.focal_length_mm\na,3\n", ParameterError, r"no table \[lens\]"),
        ("recording,rps\na," + 5000 * "1" + "\n", ParameterError, "number"),
        (b"recording,rps\n\xff\xfe,3\n", RecordingError, "no UTF-8"),
        ('recording,rps\n"' + 200_000 * "a" + '",3\n', RecordingError, "no CSV"),
        (9_000_000 * "#", RecordingError, "larger than 8 MB"),
    ],
)
def test_wrong_tables_are_refused_in_words(
    tmp_path: Path, text: str | bytes, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        stated(tmp_path, text, "a.raw")
