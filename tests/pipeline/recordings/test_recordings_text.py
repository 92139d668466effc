"""Text files: separators, names, units, packing, and lines that are no events."""

from __future__ import annotations

import gzip
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import is_recording, open_recording, write_recording
from tests.pipeline.recordings.test_recordings_raw import assert_same_events, moving_edge
from tests.reference.recordings import Event, columns

N = 600


def lines_of(line: Callable[[int, int, int, bool], str], events: EventBatch) -> str:
    return "".join(f"{line(*event)}\n" for event in columns(events))


LAYOUTS: dict[str, tuple[str, Callable[[int, int, int, bool], str]]] = {
    "named": ("t_us,x,y,p\n", lambda t, x, y, on: f"{t},{x},{y},{int(on)}"),
    "named in another order, among others": (
        "index;polarity;y;x;timestamp [ms]\n",
        lambda t, x, y, on: f"7; {2 * int(on) - 1}; {y}; {x}; {t / 1000}",
    ),
    "quoted": ('"t_us","x","y","p"\n', lambda t, x, y, on: f'"{t}","{x}","{y}","{int(on)}"'),
    "words for the polarity": ("x,y,t,on\n", lambda t, x, y, on: f"{x},{y},{t},{bool(on)}"),
    "commented names": ("# made by nobody\n# ts_ns x y p\n", lambda t, x, y, on: f"{t}000 {x} {y} {int(on)}"),
    "comments as of MATLAB": ("% made by nobody\n% t_us x y p\n", lambda t, x, y, on: f"{t} {x} {y} {int(on)}"),
    "size, then seconds": ("1280 720\n", lambda t, x, y, on: f"{t / 1e6:.9f} {x} {y} {int(on)}"),
    "x, y, p, t": ("%geometry:1280,720\n", lambda t, x, y, on: f"{x},{y},{int(on)},{t}"),
    "tabs and Windows": ("", lambda t, x, y, on: f"{t}\t{x}\t{y}\t{int(on)}\r"),
    "byte order mark": ("\ufefft_us,x,y,p\n", lambda t, x, y, on: f"{t},{x},{y},{int(on)}"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_columns_are_told_by_names_or_values(tmp_path: Path, layout: str) -> None:
    events = moving_edge(N)
    head, line = LAYOUTS[layout]
    (tmp_path / "a.txt").write_text(head + lines_of(line, events), encoding="utf-8", newline="")
    recording = open_recording(tmp_path / "a.txt", sensor=None if "720" in head else (1280, 720))
    assert_same_events(recording.read(), events)
    assert (recording.format, recording.sensor_from) == ("text", "file" if "720" in head else "command line")
    assert not recording.damage.sentences()


def test_packed_texts_are_read(tmp_path: Path) -> None:
    events = moving_edge(N)
    write_recording(tmp_path / "a.csv", events, width_px=1280, height_px=720)
    text = (tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(text))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("readme.md", "none")
        archive.writestr("folder/events.csv", text)
    for name in ("a.csv", "a.csv.gz", "a.zip"):
        shares: list[float] = []
        recording = open_recording(tmp_path / name, sensor=(1280, 720))
        assert_same_events(recording.read(on_progress=shares.append), events)
        assert shares == sorted(shares) and shares[-1] == 1.0


@pytest.mark.parametrize("packing", ["gz", "zip"])
def test_of_damaged_packing_the_lines_before_are_read(tmp_path: Path, packing: str) -> None:
    events = moving_edge(20_000)
    text = (LAYOUTS["named"][0] + lines_of(LAYOUTS["named"][1], events)).encode()
    path = tmp_path / f"a.{packing}"
    if packing == "gz":
        data = gzip.compress(text)
        path.write_bytes(data[: len(data) // 2])
    else:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.csv", text)
        data = bytearray(path.read_bytes())
        data[-400] ^= 0xFF  # what follows unpacks to other lines, of which few may be there
        path.write_bytes(data)
    recording = open_recording(path, sensor=(1280, 720))
    found = columns(recording.read())
    assert len(found) > 5000 and found[:5000] == columns(events)[:5000]
    assert recording.damage.broken_ends == 1


def test_lines_that_are_no_events_cost_themselves(tmp_path: Path) -> None:
    events = moving_edge(N)
    lines = lines_of(LAYOUTS["named"][1], events).splitlines()
    lines[100] = "# a remark"
    lines[200] = ""
    lines[300] = lines[300].rpartition(",")[0]
    lines[400] = "9" * 30 + ",1,1,1"
    lines[500] = "12,ab,1,1"
    (tmp_path / "a.csv").write_text("t_us,x,y,p\n" + "\n".join(lines)[:-2], encoding="utf-8")
    recording = open_recording(tmp_path / "a.csv", sensor=(1280, 720))
    gone = (100, 200, 300, 400, 500, N - 1)
    assert columns(recording.read()) == [event for k, event in enumerate(columns(events)) if k not in gone]
    assert recording.damage.broken_events == 4


def test_texts_with_many_such_lines_are_refused(tmp_path: Path) -> None:
    text = LAYOUTS["named"][0] + lines_of(LAYOUTS["named"][1], moving_edge(N)) + "1,2\n" * 30
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match="over 16 of the first 630 lines are no events"):
        open_recording(tmp_path / "a.csv", sensor=(1280, 720)).read()


def test_tables_of_other_columns_are_no_recordings(tmp_path: Path) -> None:
    """Labels of the ball and tables of results lie beside recordings."""
    for names in ("t_us,ball,x_px,y_px,radius_px,std_px", "recording,shot,start_us,end_us"):
        (tmp_path / "a.csv").write_text(f"{names}\n" + "1000,1,20.5,30.2,10.1,0.2\n" * 9, encoding="utf-8")
        assert not is_recording(tmp_path / "a.csv")


def test_columns_that_cannot_be_told_apart_are_refused(tmp_path: Path) -> None:
    for text in ("1,2,3,4\n5,6,7,8\n", "1,2,3,1,9\n4,5,6,0,9\n"):
        (tmp_path / "a.csv").write_text(text, encoding="utf-8")
        with pytest.raises(RecordingError, match=r"give it a first line with names, like t_us,x,y,p.*a\.csv"):
            open_recording(tmp_path / "a.csv")


def test_a_packed_text_that_grows_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.recordings.column_types.EXPANSION_FREE_BYTES", 1 << 17)
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(b"t_us,x,y,p\n" + b"1,1,1,1\n" * 200_000))
    with pytest.raises(RecordingError, match="this is no real recording"):
        open_recording(tmp_path / "a.csv.gz", sensor=(640, 480)).read()


def test_in_a_folder_only_texts_with_events_are_recordings(tmp_path: Path) -> None:
    write_recording(tmp_path / "events.csv", moving_edge(3), width_px=1280, height_px=720)
    write_recording(tmp_path / "empty.csv", moving_edge(0), width_px=1280, height_px=720)
    (tmp_path / "shots.csv").write_text("recording,shot,rps\na.h5,1,49.9\n", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("1 2 3 go\n", encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir() if is_recording(path)) == ["empty.csv", "events.csv"]
    assert len(open_recording(tmp_path / "empty.csv").read()) == 0


EVENTS = st.lists(st.tuples(st.integers(0, 2**50), st.integers(0, 1279), st.integers(0, 719), st.booleans()))


@given(EVENTS)
def test_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, events: list[Event]) -> None:
    path = tmp_path_factory.mktemp("text") / "a.csv"
    ordered = sorted(events, key=lambda event: event[0])
    t, x, y, on = zip(*ordered, strict=True) if ordered else ((), (), (), ())
    size = {"width_px": 1280, "height_px": 720}
    write_recording(path, EventBatch.checked(t, x, y, on, **size), **size)
    assert columns(open_recording(path, sensor=(1280, 720)).read()) == ordered
