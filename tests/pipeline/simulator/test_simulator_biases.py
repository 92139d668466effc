"""Biases: curves, and files."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.biases import (
    CURVES,
    FACTORY,
    PAPER,
    BiasCurve,
    BiasParameters,
    read_bias_values,
    read_biases,
    write_biases,
)
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.simulator import SensorModel

# Which way the quantity goes as its bias rises.
RISING = {
    "threshold_on",
    "threshold_off",
    "cutoff_hz",
    "highpass_hz",
    "noise_bandwidth_factor",
    "noise_refractory_factor",
}


@pytest.mark.parametrize("name", CURVES)
def test_curves_are_monotone_over_the_makers_whole_range(name):
    curve = CURVES[name]
    declared = BiasParameters.tunables()[curve.bias]
    assert curve.points[0][0] == declared.low
    assert curve.points[-1][0] == declared.high
    values = [curve.at(value) for value in np.linspace(declared.low, declared.high, 200)]
    change = np.diff(values)
    assert np.all(change > 0) if name in RISING else np.all(change < 0)
    for value, quantity in curve.points:
        assert curve.at(value) == pytest.approx(quantity)
    assert not curve.calibrated


def test_ones_own_curves_replace_ours():
    mine = BiasCurve("refr", ((-20, 100.0), (235, 10.0)), calibrated=True)
    assert SensorModel.of(PAPER, {**CURVES, "refractory_us": mine}).refractory_us == pytest.approx(mine.at(80))
    assert SensorModel.of(PAPER).noise_hz == pytest.approx(SensorModel.noise_hz)
    assert SensorModel.of(FACTORY).threshold_on < SensorModel.of(PAPER).threshold_on


def noise(**biases: int) -> tuple[float, float]:
    """Rates of ON and OFF noise over those of the paper's biases."""
    sensor = SensorModel.of(replace(PAPER, **biases))
    rate = 2 * sensor.noise_hz / SensorModel.noise_hz
    return rate * sensor.noise_on_share, rate * (1 - sensor.noise_on_share)


def test_noise_rises_with_bandwidth_and_after_short_dead_times_on_more_than_off():
    """The supplement's directions: each bias changed alone, from the paper's."""
    assert noise() == pytest.approx((1.0, 1.0))
    on, off = noise(refr=200)
    assert on > off > 1.0
    assert on == pytest.approx(off**2)
    for quieter in ({"fo": -20}, {"hpf": 60}, {"diff_on": 100, "diff_off": 100}):
        assert max(noise(**quieter)) < 1.0
    assert noise(diff_on=0)[1] == pytest.approx(1.0)


def test_files_come_back(tmp_path: Path):
    file = tmp_path / "mine.bias"
    write_biases(PAPER, file)
    assert file.read_text() == ("40 % bias_diff_on\n40 % bias_diff_off\n55 % bias_fo\n0 % bias_hpf\n80 % bias_refr\n")
    assert read_biases(file) == PAPER
    file.write_text("\n  -20   %  bias_refr  \n\n")
    assert read_biases(file) == replace(FACTORY, refr=-20)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("40 bias_fo\n", RecordingError, "line 1"),
        ("much % bias_fo\n", RecordingError, "line 1"),
        ("40 % bias_pr\n", ParameterError, "bias_pr is unknown"),
        ("900 % bias_fo\n", ParameterError, "out of range"),
        # Stock files of the GenX320 and of the Gen3.1: absolute values, some within the IMX636's ranges.
        ("51 % bias_diff\n40 % bias_diff_on\n40 % bias_diff_off\n29 % bias_fo\n", ParameterError, "bias_diff = 51"),
        ("299 % bias_diff\n1507 % bias_fo_n\n1250 % bias_pr\n", ParameterError, "bias_fo_n is unknown.*absolute"),
        ("4 % bias_fo\n5 % bias_fo\n", RecordingError, "stated twice"),
        ("% nothing but a comment\n", RecordingError, "states no bias"),
        ("4 %\n", RecordingError, "line 1"),
        ("{}", RecordingError, "ll_biases_state"),
        ('{"ll_biases_state": {"bias": [7]}}', RecordingError, "ll_biases_state"),
        ("[" * 100_000, RecordingError, "line 1"),
        ('{"a":' * 100_000, RecordingError, "ll_biases_state"),
        ("0 % bias_fo\n" * 100_000, RecordingError, "larger than"),
    ],
)
def test_bad_files_are_refused_in_words(tmp_path: Path, text: str, error: type[Exception], words: str):
    file = tmp_path / "bad.bias"
    file.write_text(text)
    with pytest.raises(error, match=words):
        read_biases(file)


STOCK = "% subsystem_ID 1\n% system_ID 49\n20   % bias_diff_off   %   v\n-10  % bias_diff_on   %   v\n0 % bias_fo % i\n"
SETTINGS = {
    "ll_biases_state": {
        "bias": [
            {"name": "bias_diff", "value": 0},
            {"name": "bias_diff_off", "value": 20},
            {"name": "bias_diff_on", "value": -10},
            {"name": "bias_fo"},  # protobuf's JSON may leave zeros out
        ]
    },
    "roi_state": {"enabled": False},
    "event_trail_filter_state": {"enabled": True, "filtering_type": "TRAIL", "threshold": 10000},
}


@pytest.mark.parametrize(
    "content",
    [
        STOCK.encode(),
        b"\xef\xbb\xbf" + STOCK.encode(),
        STOCK.replace("\n", "\r\n").encode(),
        ("0 % bias_diff\n" + STOCK).encode(),
        STOCK.replace("% system_ID 49", "% K\xfcche").encode("latin-1"),
        STOCK.replace("20   ", "0x14 ").encode(),
        STOCK.replace("%   v", "% (-35 .. 190)").encode(),
        json.dumps(SETTINGS, indent=2).encode(),
        b"\xef\xbb\xbf" + json.dumps(SETTINGS).encode(),
    ],
)
def test_files_are_read_as_cameras_software_writes_them(tmp_path: Path, content: bytes):
    file = tmp_path / "camera.bias"
    file.write_bytes(content)
    assert read_biases(file) == replace(FACTORY, diff_on=-10, diff_off=20)


def test_biases_of_any_sensor_are_read_by_name(tmp_path: Path):
    file = tmp_path / "gen31.bias"
    file.write_text("% gen 3.1 CD standard biases\n299 % bias_diff\n1480 % bias_fo % i\n1250 % bias_pr\n")
    assert read_bias_values(file) == {"diff": 299, "fo": 1480, "pr": 1250}


@pytest.mark.skipif("SPINSCOPE_REAL_RECORDINGS" not in os.environ, reason="needs real recordings")
def test_stock_files_are_read():
    folder = Path(os.environ["SPINSCOPE_REAL_RECORDINGS"]) / "trouble"
    assert read_biases(folder / "40b_bias_imx636.bias") == FACTORY
    assert read_biases(folder / "40e_bias_comments_units.bias") == replace(FACTORY, diff_on=-10, diff_off=20)


def test_missing_files_are_refused_in_words(tmp_path: Path):
    with pytest.raises(RecordingError, match="cannot be read"):
        read_biases(tmp_path / "missing.bias")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_biases(PAPER, tmp_path / "nowhere" / "a.bias")
