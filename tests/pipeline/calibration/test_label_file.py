"""Files of labels that somebody goes through: changes are kept, and none is lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.calibration.ball_labels import ACCEPTED, DETECTED, MOVED, STEP_US, BallLabels, labels_beside
from spinscope.pipeline.calibration.label_file import HAND_STD_PX, LabelFile
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.evaluation.suites.detector import _truth_at


def labels(count: int = 10) -> BallLabels:
    """Of two flights."""
    t_us, half = 1e5 + STEP_US * np.arange(count), count // 2
    x_px, ones = np.linspace(100.0, 900.0, count), np.ones(count)
    ball = np.repeat([1, 2], [half, count - half])
    return BallLabels(t_us, x_px, 300 * ones, 16 * ones, 0.1 * ones, ball, np.full(count, DETECTED))


@pytest.fixture
def file(tmp_path: Path) -> LabelFile:
    made = LabelFile(labels_beside(tmp_path / "a.raw"))
    labels().write(made.path)
    assert made.path.name == "a.labels.csv"
    return made


def of_states(*states: str) -> BallLabels:
    own = labels()
    return replace(own._at(slice(len(states))), state=np.array(states))


def test_changes_are_kept_with_the_error_of_what_is_placed_by_hand(file: LabelFile) -> None:
    _, first = file.read()
    second = file.splice(first, 0, 2, of_states(ACCEPTED, MOVED))
    third = file.splice(second, 5, 1, labels()._at(slice(0)))
    found, version = file.read()
    assert version == third and len({first, second, third}) == 3
    assert found.state.tolist() == [ACCEPTED, MOVED, *[DETECTED] * 7]
    assert found.std_px.tolist() == [0.1, HAND_STD_PX, *[0.1] * 7]
    assert found.t_us.tolist() == np.delete(labels().t_us, 5).tolist()
    undone = file.splice(third, 5, 0, labels()._at(slice(5, 6)))
    assert file.splice(undone, 0, 2, labels()._at(slice(0, 2))) == first


def test_a_change_of_another_version_or_out_of_order_changes_nothing(file: LabelFile) -> None:
    _, version = file.read()
    empty = labels()._at(slice(0))
    for bad in [("other", 0, 1, empty), (version, 0, 10, empty), (version, 3, 0, labels()._at(slice(0, 1)))]:
        with pytest.raises(ParameterError):
            file.splice(*bad)
    assert file.read()[1] == version


def test_files_without_states_are_of_detected_labels_and_unknown_states_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t_us,x_px,y_px,radius_px,std_px,ball\n1,2,3,4,0.1,1\n")
    assert BallLabels.read(path).state.tolist() == [DETECTED]
    path.write_text("t_us,x_px,y_px,radius_px,std_px,ball,state\n1,2,3,4,0.1,1,good\n")
    with pytest.raises(RecordingError, match="state good is none of detected, accepted, moved"):
        BallLabels.read(path)


def test_the_ball_is_unknown_where_labels_in_a_row_were_deleted() -> None:
    whole = labels(20).of_ball(1)
    middle_us = float(whole.t_us[5]) + 100.0
    for deleted, is_known in (([], True), ([5], True), ([5, 6], False)):
        part = whole._at(~np.isin(np.arange(whole.t_us.size), deleted))
        found = _truth_at(part, (1280, 720), middle_us)
        assert (found is not None) == is_known
        assert found is None or found[0] == pytest.approx(np.interp(middle_us, whole.t_us, whole.x_px), abs=1e-6)
