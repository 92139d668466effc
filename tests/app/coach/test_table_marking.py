"""Marking of the table: the camera's place is that of the scene, other files and other shapes are refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from spinscope.app.coach.session import ShotSession
from spinscope.app.coach.table_marking import event_picture, mark_table, marking_recordings
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.session import Choices

from .marked_table import CORNERS_M, MIDDLE_M, SIZE_PX, TURN, corners_px, write_table_recording
from .session_shots import KNOWN


@pytest.fixture
def recording(tmp_path: Path) -> str:
    write_table_recording(tmp_path / "table.h5")
    return str(tmp_path / "table.h5")


@pytest.fixture
def session(tmp_path: Path, recording: str) -> ShotSession:
    made = ShotSession(tmp_path / "session")
    made.add(recording, KNOWN, None)
    made.add(str(tmp_path / "gone.h5"), KNOWN, None)
    return made


def test_the_corners_tell_where_the_camera_is(session: ShotSession, recording: str) -> None:
    corners = [(float(x), float(y)) for x, y in corners_px()]
    pose = mark_table(session, recording, corners, Choices())
    assert session.setting("pose") == pose and pose["off_px"] < 0.1
    found_m = (CORNERS_M @ TURN.T + MIDDLE_M) @ np.array(pose["axes"]).T + pose["camera_m"]
    assert np.abs(found_m) == pytest.approx(np.abs(CORNERS_M), abs=1e-3)  # either end may be the first
    axes = np.array(pose["axes"])
    assert np.linalg.det(axes) == pytest.approx(1.0) and pose["camera_m"][2] > 0


def test_the_picture_shows_the_edges(session: ShotSession, recording: str) -> None:
    assert marking_recordings(session) == [recording]
    packed = np.frombuffer(event_picture(session, recording, Choices()), np.uint8)
    picture = cv2.imdecode(packed, cv2.IMREAD_UNCHANGED)
    assert picture is not None and picture.shape == SIZE_PX[::-1]
    x, y = np.rint(corners_px().mean(axis=0)).astype(int)
    assert picture[y, x] == 0 and picture.max() == 255


def test_other_files_and_other_shapes_are_refused(session: ShotSession, recording: str, tmp_path: Path) -> None:
    other = tmp_path / "secret.h5"
    write_table_recording(other)
    with pytest.raises(ParameterError, match="no recording of this session"):
        event_picture(session, str(other), Choices())
    corners = [(float(x), float(y)) for x, y in corners_px()]
    with pytest.raises(ParameterError, match="in order round the table"):
        mark_table(session, recording, [corners[one] for one in (0, 2, 1, 3)], Choices())
    assert session.setting("pose") is None
