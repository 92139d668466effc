"""RAW decoders on rare and dense encodings, against slow ones and by hand; rules of the headers."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.recordings.formats.prophesee_raw.decoding import (
    EVENTS,
    STATE_SIZE,
    TRIGGERS,
    Decoded,
    initial_state,
)
from spinscope.pipeline.recordings.formats.prophesee_raw.evt2 import decode_evt2
from spinscope.pipeline.recordings.formats.prophesee_raw.evt3 import decode_evt3
from spinscope.pipeline.recordings.prophesee_header import parse_header
from tests.pipeline.recordings.test_recordings_raw import decoded, raw_of_words
from tests.reference.recordings import naive_evt2, naive_evt3

GUARD = 64  # elements behind the room given, which must stay as they are
UNTOUCHED = 77
TIMES = [0x8001, 0x8001, 0x6000]  # EVT3: TIME_HIGH 1, twice; TIME_LOW 0


def guarded(room: int, trigger_room: int) -> tuple[Decoded, list[NDArray[Any]]]:
    """Output arrays that are the front part of larger ones, and those larger ones."""
    types = (np.int64, np.uint16, np.uint16, np.uint8)
    whole = [np.full(room + GUARD, UNTOUCHED, kind) for kind in types]
    edges = [np.full(trigger_room + GUARD, UNTOUCHED, kind) for kind in (np.int64, np.uint8, np.uint8)]
    t, x, y, on = (array[:room] for array in whole)
    out = Decoded(t, x, y, on.view(np.bool_), *(array[:trigger_room] for array in edges), initial_state())
    return out, [*(array[room:] for array in whole), *(array[trigger_room:] for array in edges)]


@given(
    st.lists(st.sampled_from(["one", "all", "most", "none", "trigger"]), max_size=300),
    st.integers(32, 80),
    st.integers(1, 5),
    st.sampled_from(["EVT2.1", "EVT3"]),
)
def test_no_decoder_writes_behind_the_room_given(kinds: list[str], room: int, trigger_room: int, encoding: str) -> None:
    check_room(kinds, room, trigger_room, encoding)


@pytest.mark.parametrize("encoding", ["EVT2.1", "EVT3"])
@pytest.mark.parametrize("singles", range(33))
def test_full_vectors_may_come_with_any_room_left(singles: int, encoding: str) -> None:
    check_room(["one"] * singles + ["all"] * 12, 64, 1, encoding)


def check_room(kinds: list[str], room: int, trigger_room: int, encoding: str) -> None:
    """Dense vectors in little room: every call stops before it would overflow, and the next goes on there."""
    masks = {"one": 1, "all": 0xFFFFFFFF, "most": 0xFFFFFFFE, "none": 0, "trigger": 0}
    if encoding == "EVT3":
        bits = {kind: 0x4000 | mask & 0xFFF for kind, mask in masks.items()}
        bits |= {"one": 0x2005, "trigger": 0xA101}
        stream = [*TIMES, 0x0007, 0x3800, *(word for kind in kinds for word in (bits[kind], 0x3800)), 0x8001]
        twin = naive_evt3(stream)
        arrays = [np.array(stream, np.uint16)]
    else:
        heads = [0x8 << 28 | 1, *((0xA << 28 | 1) if kind == "trigger" else 0x1 << 28 | 5 for kind in kinds)]
        halves = [0, *(masks[kind] for kind in kinds)]
        twin = naive_evt2(heads, halves)
        arrays = [np.array(heads, np.uint32), np.array(halves, np.uint32)]
    for array in arrays:
        array.flags.writeable = False  # as those of the reader: one compilation serves both
    state = initial_state()
    found, edges, at = [], [], 0
    for _ in range(3 * len(arrays[0]) + 1):
        out, behind = guarded(room, trigger_room)
        out.state[:] = state
        rest = [array[at:] for array in arrays]
        at += int(decode_evt3(out, rest[0], True) if encoding == "EVT3" else decode_evt2(out, rest[0], rest[1], True))
        state = out.state.copy()
        assert all(np.all(array == UNTOUCHED) for array in behind)
        n, m = int(state[EVENTS]), int(state[TRIGGERS])
        found += zip(*(c[:n].tolist() for c in (out.t_us, out.x_px, out.y_px, out.on)), strict=True)
        edges += zip(*(c[:m].tolist() for c in (out.trigger_t_us, out.trigger_value, out.trigger_id)), strict=True)
        if at == len(arrays[0]):
            break
    assert at == len(arrays[0]) and state.size == STATE_SIZE
    assert found == twin.events and edges == twin.triggers


def test_a_new_time_high_of_evt3_starts_at_time_low_zero() -> None:
    words = [0x8001, 0x8001, 0x6123, 0x0005, 0x2064, 0x8002, 0x2064, 0x6007, 0x2064, 0x8002, 0x2064]
    found = decoded("EVT3", False, np.array(words, "<u2").tobytes(), [])
    assert [event[0] for event in found.events] == [0x1123, 0x2000, 0x2007, 0x2007]


@pytest.mark.parametrize("width", [12, 8])
def test_vectors_of_evt3_go_on_where_the_one_before_ended(width: int) -> None:
    word = 0x4FFF if width == 12 else 0x50FF
    words = [*TIMES, 0x0005, 0x3864, word, word, 0x4801, 0x5081, 0x3020, 0x5001, 0x8001]
    found = decoded("EVT3", False, np.array(words, "<u2").tobytes(), [])
    after = 100 + 2 * width
    x = [*range(100, after), after, after + 11, after + 12, after + 19, 32]
    assert [event[1] for event in found.events] == x
    assert [event[3] for event in found.events] == [True] * (len(x) - 1) + [False]
    assert {event[2] for event in found.events} == {5} and {event[0] for event in found.events} == {4096}


def test_vector_bits_above_8_of_a_vect_8_word_are_no_events() -> None:
    words = [*TIMES, 0x0005, 0x3864, 0x5F01, 0x5001, 0x8001]
    found = decoded("EVT3", False, np.array(words, "<u2").tobytes(), [])
    assert [event[1] for event in found.events] == [100, 108]


def test_vectors_without_a_base_or_a_row_have_no_place() -> None:
    words = [*TIMES, 0x4003, 0x0005, 0x4003, 0x3064, 0x4003, 0x37FF, 0x4003, 0x8001]
    found = decoded("EVT3", False, np.array(words, "<u2").tobytes(), [])
    assert [event[1] for event in found.events] == [100, 101, 2047]
    assert (found.untimed, found.outside) == (4, 1)


def test_words_of_other_kinds_change_nothing_and_unknown_ones_are_counted() -> None:
    plain = [*TIMES, 0x0005, 0x2801, 0x3010, 0x4003, 0x4001, 0x8001]
    for kind, bad in ((0x7, 0), (0xE, 0), (0xF, 0), (0x1, 1), (0x9, 1), (0xB, 1), (0xC, 1), (0xD, 1)):
        other = kind << 12 | 0xABC
        mixed = [word for one in plain for word in (other, one)]
        found = decoded("EVT3", False, np.array(mixed, "<u2").tobytes(), [5, 8, 11])
        assert found.events == naive_evt3(plain).events and len(found.events) == 4
        assert found.bad_words == bad * len(plain)
    for kind, bad in ((0xE, 0), (0xF, 0), *((k, 1) for k in (*range(2, 8), 0x9, 0xB, 0xC, 0xD))):
        heads = [kind << 28, 0x8 << 28 | 3, kind << 28 | 8, 0x1 << 28 | 9 << 11]
        found = decoded("EVT2", False, np.array(heads, "<u4").tobytes(), [7])
        assert found.events == [(192, 9, 0, True)] and found.bad_words == 2 * bad


def test_a_long_step_is_back_only_when_it_does_not_lead_to_before_0() -> None:
    """More than half a turn ahead: at the start of a file it is ahead, after a turn it is back."""
    first = [0x8050, 0x8050, 0x8050, 0x0005, 0x2001, 0x8BB8, 0x2001, 0x8BB9, 0x2002]
    found = decoded("EVT3", False, np.array(first, "<u2").tobytes(), [])
    assert (
        [event[0] >> 12 for event in found.events] == [80, 3000, 3001] == [e[0] >> 12 for e in naive_evt3(first).events]
    )
    later = [*first, 0x8FFF, 0x8000, 0x8001, 0x2003, 0x8FF0, 0x8FF1, 0x2004]
    found = decoded("EVT3", False, np.array(later, "<u2").tobytes(), [])
    assert [event[0] >> 12 for event in found.events] == [80, 3000, 3001, 4097, 4081]
    assert found == naive_evt3(later) and found.time_jumps == 0


def test_triggers_have_five_bits_of_id_in_evt2_and_four_in_evt3() -> None:
    evt2 = [0x8 << 28 | 1, 0xA << 28 | 9 << 22 | 0x1F << 8 | 1, 0xA << 28 | 10 << 22 | 0x2 << 8]
    assert decoded("EVT2", False, np.array(evt2, "<u4").tobytes(), []).triggers == [(73, 1, 31), (74, 0, 2)]
    evt3 = [*TIMES, 0x6009, 0xAF01, 0x600A, 0xA200, 0x8001]
    assert decoded("EVT3", False, np.array(evt3, "<u2").tobytes(), []).triggers == [(4105, 1, 15), (4106, 0, 2)]


def test_evt21_masks_reach_over_32_pixels_and_end_at_the_last_column() -> None:
    heads = [0x8 << 28 | 1, 0x1 << 28 | 100 << 11, 0x0 << 28 | 2030 << 11 | 3]
    masks = [0, 0x80000001, 0xFFFFFFFF]
    data = np.array([heads, masks], "<u4").T.tobytes()
    found = decoded("EVT2.1", True, data, [3])
    assert [event[1] for event in found.events] == [100, 131, *range(2030, 2048)]
    assert [event[3] for event in found.events[:3]] == [True, True, False] and found.outside == 14


@pytest.mark.parametrize(
    ("head", "values", "rest"),
    [
        (b"% evt 3.0\n% end\ndata", {"evt": "3.0"}, b"data"),
        (b"% evt 3.0\ndata", {"evt": "3.0"}, b"data"),  # old files end without a line of their own
        (b"% evt 3.0\r\n% end\r\ndata", {"evt": "3.0"}, b"data"),
        (b"% a  two words \n% b\n% a again\n%data", {"a": "again", "b": ""}, b"%data"),
        (b"% ending x\n% end\n% evt 2.0\n", {"ending": "x"}, b"% evt 2.0\n"),
        (b"% name \xff\n\x00", {"name": "\ufffd"}, b"\x00"),
        (b"% evt 3.0\n% cut wit", {"evt": "3.0"}, b""),
        (b"data", {}, b"data"),
        (b"", {}, b""),
    ],
)
def test_headers_are_lines_up_to_the_end_or_the_first_other_byte(
    head: bytes, values: dict[str, str], rest: bytes
) -> None:
    found, end = parse_header(head)
    assert found == values and head[end:] == rest


@pytest.mark.parametrize(
    ("lines", "size", "origin"),
    [
        (["evt 3.0", "geometry 640x480", "format EVT3;height=720;width=1280"], (640, 480), "file"),
        (["format EVT3; height=480 ; width=640"], (640, 480), "file"),
        (["format EVT3;height=480;width=640", "system_ID 49"], (640, 480), "file"),
        (["format EVT3;height=480", "system_ID 49"], (1280, 720), "system_ID 49"),
        (["evt 3.0", "system_ID 48"], (1280, 720), "system_ID 48"),
        (["evt 3.0", "system_ID 50"], (304, 240), "guess"),
        (["evt 3.0", "system_ID x"], (304, 240), "guess"),
        (["format EVT3;height=480;width=wide"], (304, 240), "guess"),
        (["evt 3.0", "geometry 640"], (304, 240), "guess"),
    ],
)
def test_the_first_statement_of_the_size_counts(
    tmp_path: Path, lines: list[str], size: tuple[int, int], origin: str
) -> None:
    header = "".join(f"% {line}\n" for line in [*lines, "end"]).encode()
    recording = raw_of_words(tmp_path / "a.raw", [*TIMES, 0x0005, 0x2001, 0x8001], header)
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (*size, origin)
    assert recording.read().t_us.tolist() == [4096]


@pytest.mark.parametrize(
    ("lines", "format"),
    [
        (["evt 2.0"], "EVT2 RAW"),
        (["evt 2.1"], "EVT2.1 RAW"),
        (["evt 3.0"], "EVT3 RAW"),
        (["format EVT2", "evt 3.0"], "EVT2 RAW"),
        (["format EVT21;endianness=little"], "EVT2.1 RAW"),
        (["format ;height=4", "evt 3.0"], "EVT3 RAW"),
    ],
)
def test_format_beats_evt(tmp_path: Path, lines: list[str], format: str) -> None:
    (tmp_path / "a.raw").write_bytes("".join(f"% {line}\n" for line in [*lines, "end"]).encode())
    assert open_recording(tmp_path / "a.raw").format == format


def test_an_unknown_order_of_halves_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(b"% format EVT21;endianness=big\n% end\n")
    with pytest.raises(RecordingError, match=r"endianness 'big' is not read.*a\.raw$"):
        open_recording(tmp_path / "a.raw")


@given(st.lists(st.tuples(st.integers(0, 4095), st.integers(0, 3)), min_size=2, max_size=12))
def test_time_high_words_alone_keep_time_in_order(steps: list[tuple[int, int]]) -> None:
    """Whatever TIME_HIGH words come, confirmed steps ahead are taken and wraps counted as by the slow decoder."""
    words = [0x0005]
    for high, events in steps:
        words += [0x8000 | high, 0x6000, *[0x2001] * events]
    found = decoded("EVT3", False, np.array(words, "<u2").tobytes(), [9, 14, 31])
    assert found == naive_evt3(words)
    backward = [b[0] < a[0] for a, b in pairwise(found.events)]
    assert len(backward) == max(len(found.events) - 1, 0)
