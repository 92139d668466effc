"""A recording format of one's own: registered in one place, found wherever recordings are named."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import (
    FORMATS,
    FormatReader,
    ReadPass,
    RecordingContent,
    RecordingFormat,
    UncheckedEvents,
    open_recording,
    readable_suffixes,
    writable_suffixes,
    write_recording,
)
from tests.pipeline.recordings.test_recordings_raw import assert_same_events, moving_edge

FIRST_LINE = "toy recording"


class ToyReader(FormatReader):
    """Reader of a text file with one event a line."""

    format = "toy text"

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield all events at once."""
        t, x, y, on = np.loadtxt(self.path, np.int64, skiprows=1).T
        yield UncheckedEvents(t, x, y, on != 0)
        reading.report(1, 1)


def write_toy(path: Path, content: RecordingContent) -> None:
    lines = [FIRST_LINE]
    for batch in content.batches:
        columns = (batch.t_us, batch.x_px, batch.y_px, batch.on.astype(int))
        lines += [" ".join(map(str, event)) for event in zip(*(c.tolist() for c in columns), strict=True)]
    path.write_text("\n".join(lines), encoding="ascii")


TOY = RecordingFormat(
    name="toy",
    label="Toy text",
    suffixes=(".toy", ".toytext"),
    sniff=lambda path, head: head.startswith(FIRST_LINE.encode()),
    open=ToyReader,
    write=write_toy,
)


@pytest.fixture
def toy() -> Iterator[RecordingFormat]:
    with FORMATS.registered(TOY) as format:
        yield format


def spinscope(*arguments: Any) -> str:
    done = CliRunner().invoke(cli, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.usefixtures("toy")
def test_a_toy_format_is_found_in_info_convert_and_the_lists_of_suffixes(tmp_path: Path) -> None:
    events = moving_edge(300)
    write_recording(tmp_path / "a.h5", events, width_px=1280, height_px=720)
    spinscope("convert", tmp_path / "a.h5", tmp_path / "b.toy")
    assert (tmp_path / "b.toy").read_text(encoding="ascii").startswith(FIRST_LINE)
    information = json.loads(spinscope("info", tmp_path / "b.toy", "--json", "-"))
    assert information["format"] == "toy text" and information["events"] == 300
    assert "toy text" in spinscope("info", tmp_path / "b.toy")
    spinscope("convert", tmp_path / "b.toy", tmp_path / "c.h5", "--sensor", "1280x720")
    assert_same_events(open_recording(tmp_path / "c.h5").read(), events)
    assert {".toy", ".toytext"} <= set(readable_suffixes()) & set(writable_suffixes())


@pytest.mark.usefixtures("toy")
def test_a_toy_format_is_recognised_by_its_content_and_named_in_messages(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.TOY", moving_edge(10), width_px=1280, height_px=720)
    (tmp_path / "a.TOY").rename(tmp_path / "a.raw")
    assert open_recording(tmp_path / "a.raw").format == "toy text"
    (tmp_path / "b.toy").write_bytes(b"other text")
    with pytest.raises(RecordingError, match=r"file named \.toy is no Toy text file.*Toy text \(\.toy, \.toytext\)"):
        open_recording(tmp_path / "b.toy")


def test_it_is_gone_afterwards(tmp_path: Path) -> None:
    assert ".toy" not in readable_suffixes()
    with pytest.raises(RecordingError, match=r"suffix '\.toy' is no format"):
        write_recording(tmp_path / "a.toy", moving_edge(10), width_px=1280, height_px=720)
