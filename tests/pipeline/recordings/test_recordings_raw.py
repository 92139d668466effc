"""RAW: the decoders against slow ones, cuts and flipped bits, real recordings."""

from __future__ import annotations

import os
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Recording, Triggers, open_recording, write_recording
from spinscope.pipeline.recordings.formats.prophesee_raw.decoding import BAD_WORDS, OUTSIDE, TIME_JUMPS, UNTIMED
from spinscope.pipeline.recordings.formats.prophesee_raw.reader import RawDecoder
from spinscope.pipeline.recordings.reader import ReadPass
from tests.reference.recordings import NaiveDecoded, columns, naive_evt2, naive_evt3, naive_order, write_evt2

EVT3_HEADER = b"% evt 3.0\n% format EVT3;height=720;width=1280\n% geometry 1280x720\n% end\n"
WRITE = {"EVT3": write_recording, "EVT2": partial(write_recording, encoding="EVT2")}
KINDS = [0x0, 0x2, 0x2, 0x3, 0x4, 0x5, 0x6, 0x6, 0x8, 0x8, 0xA, 0x1, 0x7, 0xE, 0xF, 0xC]
HIGHS = st.one_of(st.integers(0, 4), st.integers(4090, 4095), st.integers(0, 4095))


def evt3_word(kind: int, value: int, high: int) -> int:
    return kind << 12 | (high if kind == 0x8 else value)


EVT3_WORDS = st.lists(st.builds(evt3_word, st.sampled_from(KINDS), st.integers(0, 0xFFF), HIGHS), max_size=60)


def evt2_word(kind: int, value: int, high: int) -> int:
    return kind << 28 | (high if kind == 0x8 else value)


EVT2_WORDS = st.lists(
    st.builds(
        evt2_word,
        st.sampled_from([0x0, 0x1, 0x1, 0x8, 0x8, 0xA, 0xE, 0xF, 0x3]),
        st.integers(0, (1 << 28) - 1),
        st.one_of(st.integers(0, 300), st.integers((1 << 28) - 300, (1 << 28) - 1), st.integers(0, (1 << 28) - 1)),
    ),
    max_size=60,
)
CUTS = st.lists(st.integers(0, 600), max_size=5)


def decoded(encoding: str, legacy: bool, data: bytes, cuts: list[int]) -> NaiveDecoded:
    """What the decoder makes of the bytes when they come in pieces, in the twin's form."""
    reading = ReadPass()
    decoder = RawDecoder(encoding, legacy, reading)
    out = NaiveDecoded()
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    blocks = [data[a:b] for a, b in pairwise(places)]
    for block, final in [*((block, False) for block in blocks), (b"", True)]:
        for c in decoder.feed(block, final):
            out.events += zip(c.t_us.tolist(), c.x.tolist(), c.y.tolist(), c.on.tolist(), strict=True)
    for t in reading.triggers:
        out.triggers += zip(t.t_us.tolist(), t.value.tolist(), t.id.tolist(), strict=True)
    state = decoder._state.tolist()
    out.bad_words, out.time_jumps = state[BAD_WORDS], state[TIME_JUMPS]
    out.untimed, out.outside = state[UNTIMED], state[OUTSIDE]
    return out


@given(EVT3_WORDS, CUTS)
def test_evt3_is_decoded_as_by_its_twin_however_it_is_cut(words: list[int], cuts: list[int]) -> None:
    assert decoded("EVT3", False, np.array(words, "<u2").tobytes(), cuts) == naive_evt3(words)


@given(EVT2_WORDS, CUTS)
def test_evt2_is_decoded_as_by_its_twin_however_it_is_cut(words: list[int], cuts: list[int]) -> None:
    assert decoded("EVT2", False, np.array(words, "<u4").tobytes(), cuts) == naive_evt2(words)


@given(EVT2_WORDS, st.booleans(), CUTS, st.randoms(use_true_random=False))
def test_evt21_is_decoded_as_by_its_twin_in_both_orders_of_halves(
    heads: list[int], legacy: bool, cuts: list[int], random: object
) -> None:
    masks = [random.getrandbits(32) & random.getrandbits(32) for _ in heads]
    halves = [heads, masks] if legacy else [masks, heads]
    data = np.array(halves, "<u4").T.tobytes()
    assert decoded("EVT2.1", legacy, data, cuts) == naive_evt2(heads, masks)


def moving_edge(n: int = 3000, seed: int = 3) -> EventBatch:
    """Events of an edge that crosses the sensor in 0.25 s, several a time stamp."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(4_000_000, 4_250_000, n)) // 3 * 3
    x = (t - 4_000_000) // 250 + rng.integers(0, 20, n)
    return EventBatch(
        t,
        x.astype(np.uint16),
        rng.integers(0, 720, n).astype(np.uint16),
        rng.integers(0, 2, n).astype(np.bool_),
    )


def assert_same_events(found: EventBatch, expected: EventBatch) -> None:
    for name in ("t_us", "x_px", "y_px", "on"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.parametrize("format", ["EVT3", "EVT2"])
def test_a_file_cut_at_any_byte_gives_the_events_before_the_cut(tmp_path: Path, format: str) -> None:
    events = moving_edge(50)
    path, cut = tmp_path / "whole.raw", tmp_path / "cut.raw"
    WRITE[format](path, events, width_px=1280, height_px=720)
    data = path.read_bytes()
    start = data.index(b"% end\n") + 6
    word_bytes = {"EVT3": 2, "EVT2": 4}[format]
    for end in range(start, len(data)):
        cut.write_bytes(data[:end])
        recording = open_recording(cut)
        found = recording.read()
        words = np.frombuffer(data[start : end - (end - start) % word_bytes], f"<u{word_bytes}").tolist()
        whole = naive_evt3(words) if format == "EVT3" else naive_evt2(words)
        assert len(found) == len(whole.events)
        assert_same_events(found, events[: len(found)])
        assert recording.damage.lost_bytes == (end - start) % word_bytes
    assert len(found) == len(events)


@pytest.mark.parametrize("format", ["EVT3", "EVT2"])
def test_a_header_cut_anywhere_is_refused_or_empty(tmp_path: Path, format: str) -> None:
    path = tmp_path / "whole.raw"
    WRITE[format](path, moving_edge(20), width_px=1280, height_px=720)
    data = path.read_bytes()
    for end in range(1, data.index(b"% end\n") + 6):
        path.write_bytes(data[:end])
        try:
            assert len(open_recording(path).read()) == 0
        except RecordingError as error:
            assert str(path) in str(error)


@pytest.mark.parametrize("bit", range(12))
@pytest.mark.parametrize("which", [0, 5, 30])
def test_one_flipped_bit_in_a_time_word_costs_milliseconds_only(tmp_path: Path, bit: int, which: int) -> None:
    """Without the look ahead, a flip of the highest bit would shift all later events by 16.8 s."""
    events = moving_edge()
    path = tmp_path / "flipped.raw"
    write_recording(path, events, width_px=1280, height_px=720)
    data = bytearray(path.read_bytes())
    start = data.index(b"% end\n") + 6
    words = np.frombuffer(bytes(data[start:]), "<u2")
    place = start + 2 * int(np.flatnonzero(words >> 12 == 0x8)[which])
    data[place + bit // 8] ^= 1 << (bit % 8)
    path.write_bytes(data)
    found = open_recording(path).read()
    shared = np.isin(events.t_us, found.t_us)
    assert np.count_nonzero(~shared) <= 3000 * 3 * 4096 / 250_000  # three TIME_HIGH of 4096 us at most
    assert found.t_us[0] >= 0 and found.t_us[-1] <= events.t_us[-1] + 8192


def test_time_wraps_and_goes_on(tmp_path: Path) -> None:
    """EVT3 wraps after 16.8 s: 70 s of events in steps of 3 s, as sensors send them and in one jump."""
    t = np.arange(0, 70_000_000, 3_000_000)
    zeros = np.zeros(t.size, np.uint16)
    events = EventBatch(t, zeros, zeros.copy(), np.ones(t.size, np.bool_))
    write_recording(tmp_path / "wraps.raw", events, width_px=1280, height_px=720)
    assert_same_events(open_recording(tmp_path / "wraps.raw").read(), events)


@st.composite
def recordings(draw: st.DrawFn) -> tuple[EventBatch, Triggers]:
    """Up to 40 events and 5 triggers with gaps from nothing to an hour."""
    gap = st.one_of(st.integers(0, 3), st.integers(0, 9000), st.integers(0, 20_000_000), st.integers(0, 3_600_000_000))
    t = np.cumsum(draw(st.lists(gap, max_size=40)), dtype=np.int64)
    edges = np.sort(np.array(draw(st.lists(st.integers(0, 10**8), max_size=5)), np.int64))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    events = EventBatch(
        t,
        rng.integers(0, 2048, t.size).astype(np.uint16),
        rng.integers(0, 2048, t.size).astype(np.uint16),
        rng.integers(0, 2, t.size).astype(np.bool_),
    )
    n = edges.size
    return events, Triggers(edges, rng.integers(0, 2, n).astype(np.uint8), rng.integers(0, 16, n).astype(np.uint8))


@settings(max_examples=60)
@given(recordings(), st.sampled_from(["EVT2", "EVT3"]))
def test_raw_round_trip_is_exact(
    tmp_path_factory: pytest.TempPathFactory, recorded: tuple[EventBatch, Triggers], format: str
) -> None:
    path = tmp_path_factory.mktemp("raw") / "round.raw"
    events, triggers = recorded
    WRITE[format](path, events, width_px=2048, height_px=2048, triggers=triggers)
    recording = open_recording(path)
    assert_same_events(recording.read(), events)
    for name in ("t_us", "value", "id"):
        np.testing.assert_array_equal(getattr(recording.triggers, name), getattr(triggers, name))
    assert not recording.damage.sentences()
    assert recording.format == f"{format} RAW"


@settings(max_examples=30)
@given(recordings())
def test_evt2_is_written_as_by_its_twin(
    tmp_path_factory: pytest.TempPathFactory, recorded: tuple[EventBatch, Triggers]
) -> None:
    folder = tmp_path_factory.mktemp("raw")
    for name, write in (("a.raw", WRITE["EVT2"]), ("b.raw", write_evt2)):
        write(folder / name, recorded[0], width_px=2048, height_px=2048, triggers=recorded[1])
    assert (folder / "a.raw").read_bytes() == (folder / "b.raw").read_bytes()


def test_evt2_holds_gaps_of_days(tmp_path: Path) -> None:
    t = np.array([0, 1, 9 * 3_600_000_000, 30 * 3_600_000_000, 30 * 3_600_000_000 + 63])
    events = EventBatch(t, t.astype(np.uint16) * 0 + 5, t.astype(np.uint16) * 0 + 6, t % 2 == 0)
    WRITE["EVT2"](tmp_path / "a.raw", events, width_px=640, height_px=480)
    assert_same_events(open_recording(tmp_path / "a.raw").read(), events)


def raw_of_words(path: Path, words: list[int], header: bytes = EVT3_HEADER) -> Recording:
    path.write_bytes(header + np.array(words, "<u2").tobytes())
    return open_recording(path)


def test_late_events_of_raw_files_are_dropped_and_said(tmp_path: Path) -> None:
    """A clock that is set back for good: what lies before the time already reached is dropped."""
    words = [0x8100, 0x8100, 0x6000, 0x0005, 0x2001, 0x80F0, 0x6000, 0x2002, 0x80F0, 0x8101, 0x6001, 0x2003]
    recording = raw_of_words(tmp_path / "late.raw", words)
    assert recording.read().x_px.tolist() == [1, 3]
    assert recording.damage.late_events == 1 and recording.damage.backward_steps == 1
    assert any("1 events more than 10 ms behind" in warning for warning in recording.warnings)


@given(EVT3_WORDS)
@settings(max_examples=50)
def test_a_raw_recording_is_its_words_in_order(tmp_path_factory: pytest.TempPathFactory, words: list[int]) -> None:
    recording = raw_of_words(tmp_path_factory.mktemp("raw") / "words.raw", words)
    found = recording.read()
    twin = naive_evt3(words)
    ordered, backward, late = naive_order(twin.events)
    inside = [event for event in ordered if event[1] < 1280 and event[2] < 720]
    assert columns(found) == inside
    damage = recording.damage
    assert (damage.backward_steps, damage.late_events) == (backward, late)
    assert damage.outside_events == twin.outside + len(ordered) - len(inside)
    assert damage.untimed_events == twin.untimed and damage.bad_words == twin.bad_words


@pytest.mark.parametrize(
    ("header", "size", "source"),
    [
        (b"% evt 3.0\n% geometry 640x480\n% end\n", (640, 480), "file"),
        (b"% format EVT3;height=480;width=640\n% end\n", (640, 480), "file"),
        (b"% evt 3.0\n% system_ID 21\n", (640, 480), "system_ID 21"),
        (b"% evt 3.0\n% system_ID 49\n% end\n", (1280, 720), "system_ID 49"),
        (b"% evt 3.0\n", (304, 240), "guess"),
        (b"% evt 3.0\n% geometry 0x0\n% end\n", (304, 240), "guess"),
    ],
)
def test_headers_old_and_new_say_the_sensor(tmp_path: Path, header: bytes, size: tuple[int, int], source: str) -> None:
    recording = raw_of_words(tmp_path / "a.raw", [0x8001, 0x6000, 0x0005, 0x2001], header)
    assert (recording.width_px, recording.height_px) == size and recording.sensor_from == source
    assert len(recording.read()) == 1
    assert bool(recording.warnings) == (source == "guess")


@pytest.mark.parametrize("head", [b"% camera x\n% end\n", b"% evt 4.0\n% end\n", b"% format HISTO3D\n% end\n"])
def test_other_encodings_are_refused(tmp_path: Path, head: bytes) -> None:
    (tmp_path / "a.raw").write_bytes(head + bytes(8))
    with pytest.raises(RecordingError, match=r"EVT2, EVT2\.1 and EVT3 are read.*a\.raw$"):
        open_recording(tmp_path / "a.raw")


def test_an_unknown_order_of_halves_is_refused_in_one_short_line(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(b"% format EVT21;endianness=lit\xff\x0b" + bytes(3000) + b"\n% end\n")
    with pytest.raises(RecordingError, match=r"^EVT2\.1 with endianness 'lit.*is not read.*a\.raw$") as error:
        open_recording(tmp_path / "a.raw")
    assert len(str(error.value)) < 400


@pytest.mark.parametrize("stated", ["legacy", "little", ""])
@pytest.mark.parametrize("legacy", [True, False])
def test_evt21_finds_the_order_of_its_halves(tmp_path: Path, stated: str, legacy: bool) -> None:
    if stated and (stated == "legacy") != legacy:
        pytest.skip("the header would lie")
    heads, masks = [], []
    for high in range(100, 140):
        heads += [0x8 << 28 | high, 0x1 << 28 | 7 << 22 | 64 << 11 | 5]
        masks += [0, 0x80000101]
    data = np.array([heads, masks] if legacy else [masks, heads], "<u4").T.tobytes()
    ending = f";endianness={stated}" if stated else ""
    path = tmp_path / "a.raw"
    path.write_bytes(f"% format EVT21;height=720;width=1280{ending}\n% end\n".encode() + data)
    recording = open_recording(path)
    events = recording.read()
    assert events.x_px[:3].tolist() == [64, 72, 95] and events.t_us[0] == 6407 and len(events) == 120
    assert bool(recording.warnings) == (not stated)


REAL = os.environ.get("SPINSCOPE_REAL_RECORDINGS")
GOLDEN = {
    "gen31_cable_4157triggers_evt3.raw": (343474, 7139845, 9218023, 116731888, 80879209, 125183, 4157),
    "evk_1280x720_2triggers_evt3.raw": (82469, 14224870, 15476187, 42078718, 31656267, 41439, 2),
}


@pytest.mark.skipif(REAL is None, reason="SPINSCOPE_REAL_RECORDINGS names no folder of real recordings")
@pytest.mark.parametrize("name", GOLDEN)
def test_real_recordings_give_their_golden_numbers(name: str) -> None:
    assert REAL is not None
    recording = open_recording(Path(REAL) / name)
    e = recording.read()
    sums = [int(column.sum(dtype=np.int64)) for column in (e.x_px, e.y_px, e.on)]
    assert (len(e), int(e.t_us[0]), int(e.t_us[-1]), *sums, len(recording.triggers)) == GOLDEN[name]
    assert not recording.damage.sentences() and not recording.warnings
    if len(recording.triggers) == 2:
        assert recording.triggers.t_us.tolist() == [14547491, 14549491]
        assert recording.triggers.value.tolist() == [0, 1]
