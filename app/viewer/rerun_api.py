"""Rerun's API as Spinscope uses it; everything that Rerun calls experimental or unstable is used here alone.

Columns only: one chunk an entity, never a call a row.
"""

from __future__ import annotations

import os
import sys
import uuid
from collections.abc import Hashable, Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import Chunk as Chunk  # for the stages

from .entities import APPLICATION, TIMELINE, Colour

# Settings of the user's own programs: they switch logging off, send it elsewhere, or cut it otherwise.
LOGGING_VARIABLES = ("RERUN", "_RERUN_TEST_FORCE_SAVE", "RERUN_STRICT")
LOGGING_PREFIXES = ("RERUN_CHUNK_", "RERUN_FLUSH_")


def _leave_logging_variables_out() -> None:
    """Forget variables that change what this process logs; Rerun reads them with each recording stream."""
    for name in list(os.environ):
        if name in LOGGING_VARIABLES or name.startswith(LOGGING_PREFIXES):
            del os.environ[name]


_leave_logging_variables_out()


class _NoPandas:
    """Finder of modules that finds no pandas."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        if name == "pandas":
            raise ModuleNotFoundError(name)


def _leave_pandas_out() -> None:
    """Keep pyarrow from loading pandas, which takes a second, only to ask whether our columns are pandas' own.

    It looks for pandas at its first array, and at its first list of one, and remembers what it found.
    """
    sys.meta_path.insert(0, _NoPandas)
    try:
        pa.array(np.zeros(1))
        pa.ListArray.from_arrays(pa.array([0, 1]), np.zeros(1))
    finally:
        sys.meta_path.remove(_NoPandas)


_leave_pandas_out()


def time_column(t_us: NDArray[np.int64] | NDArray[np.float64]) -> rr.TimeColumn:
    """Times on the timeline, file time to the nanosecond; the viewer shows them as seconds, 105 000 us as 0.105 s."""
    times = np.ascontiguousarray(t_us)
    return _time_column(times.tobytes(), times.dtype)


@lru_cache(64)
def _time_column(content: bytes, kind: np.dtype[Any]) -> rr.TimeColumn:
    """Made once: nearly all entities of a run have the ticks' times, and there are 200."""
    nanoseconds = np.round(np.frombuffer(content, kind) * 1000).astype(np.int64)
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))


def columns_at(
    entity: str,
    t_us: NDArray[np.int64] | NDArray[np.float64],
    columns: Any,
    lengths: Sequence[int] | NDArray[np.int64] | None = None,
) -> Chunk:
    """Rows of an entity, one a time; with `lengths`, that many instances a row (0 = nothing is shown from then on)."""
    if lengths is not None:
        columns = columns.partition(np.asarray(lengths))
    return Chunk.from_columns(entity, indexes=[time_column(t_us)], columns=columns)


def once(entity: str, *archetypes: rr.AsComponents) -> Chunk:
    """Static values of an entity."""
    batches = [batch for archetype in archetypes for batch in archetype.as_component_batches()]
    columns = [batch.partition([len(batch.as_arrow_array())]) for batch in batches]
    return Chunk.from_columns(entity, indexes=[], columns=columns)


@lru_cache(512)
def styled(entity: str, archetype: Any, **look: Hashable) -> Chunk:
    """Look of an entity whatever the run: fields of an archetype, one value each. Made once, as it takes 0.2 ms."""
    return once(entity, archetype.from_fields(**{name: [value] for name, value in look.items()}))


def bars(
    entity: str,
    t_us: NDArray[Any],
    rows: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
    widths: Sequence[float],
    colour: Colour,
) -> list[Chunk]:
    """Bars over an axis of their own: places and heights in every row, all of a row equally wide; none for no places.

    A row of no bars would leave the last one's standing: it gets a bar without height.
    """
    shown = [(places, heights) if places.size else (np.zeros(1), np.zeros(1)) for places, heights in rows]
    lengths = [len(places) for places, _ in shown]
    like = _bar(colour)
    columns = {
        "values": (_tensors([heights for _, heights in shown]), None),
        "abscissa": (_tensors([places for places, _ in shown]), None),
        "widths": (pa.array(np.repeat(np.array(widths, np.float32), lengths)), lengths),
        "color": (pa.array(np.full(len(rows), like[1].as_arrow_array()[0].as_py(), np.uint32)), None),
    }
    made = []
    for batch in like:
        array, parts = columns[batch.component_descriptor().component.split(":")[-1]]
        whole = rr.DescribedComponentBatch(_Arrow(array), batch.component_descriptor())
        made.append(whole.partition([1] * len(rows) if parts is None else parts))
    return [columns_at(entity, t_us, made)]


@lru_cache
def _bar(colour: Colour) -> list[rr.DescribedComponentBatch]:
    """Single bar, with every component of a row of bars."""
    one = np.zeros(1)
    return list(rr.BarChart(one, abscissa=one, widths=one, color=colour).as_component_batches())


def _tensors(rows: Sequence[NDArray[np.float64]]) -> pa.Array:
    """Tensors of one dimension, one a row. Rerun's own batches hold one tensor, and making one takes 0.3 ms."""
    whole = rr.components.TensorDataBatch._ARROW_DATATYPE
    shape, names, buffer = whole.fields
    kinds = list(buffer.type)
    starts = pa.array(np.cumsum([0, *map(len, rows)], dtype=np.int32))
    index = next(i for i, kind in enumerate(kinds) if kind.name == "F64")
    children = [pa.nulls(0, kind.type) for kind in kinds]
    children[index] = pa.ListArray.from_arrays(starts, pa.array(np.concatenate(rows)), type=kinds[index].type)
    which = pa.array(np.full(len(rows), buffer.type.type_codes[index], np.int8))
    places = pa.array(np.arange(len(rows), dtype=np.int32))
    buffers = [None, which.buffers()[1], places.buffers()[1]]
    tensors = pa.Array.from_buffers(buffer.type, len(rows), buffers, children=children)
    shapes = pa.array([[len(row)] for row in rows], shape.type)
    return pa.StructArray.from_arrays([shapes, pa.nulls(len(rows), names.type), tensors], fields=whole.fields)


def strips(lines: Sequence[NDArray[Any]] | NDArray[Any], dimensions: int = 2) -> pa.Array:
    """Lines (n, 2) or (n, 3), each with its own n, as `strips` of line strips.

    Rerun takes lists of arrays as well, and makes a batch of each: for 300 lines that takes 13 times as long.
    """
    kind = rr.components.LineStrip2DBatch if dimensions == 2 else rr.components.LineStrip3DBatch
    whole = kind._ARROW_DATATYPE
    starts = pa.array(np.cumsum([0, *map(len, lines)], dtype=np.int32))
    parts = [lines.ravel()] if isinstance(lines, np.ndarray) else [np.empty(0), *(np.ravel(line) for line in lines)]
    flat = np.concatenate(parts).astype(np.float32)
    points = pa.FixedSizeListArray.from_arrays(pa.array(flat), type=whole.value_type)
    return pa.ListArray.from_arrays(starts, points, type=whole)


class _Arrow:
    """Arrow array as one of Rerun's batches."""

    def __init__(self, array: pa.Array) -> None:
        self._array = array

    def as_arrow_array(self) -> pa.Array:
        return self._array


def states(entity: str, t_us: NDArray[Any], names: Sequence[str], colours: dict[str, Colour]) -> list[Chunk]:
    """Lane of states over time, with a row where the state changes."""
    changed = [i for i, name in enumerate(names) if i == 0 or name != names[i - 1]]
    style = rr.StateConfiguration(
        values=list(colours), labels=list(colours), colors=[(*colour, 255) for colour in colours.values()]
    )
    columns = rr.StateChange.columns(state=[names[i] for i in changed])
    return [columns_at(entity, np.asarray(t_us)[changed], columns), once(entity, style)]


def file_content(chunks: Iterable[Chunk], blueprint: rrb.Blueprint, name: str) -> bytes:
    """Bytes of an .rrd file with a blueprint in it, which becomes the active one when the file is opened.

    Rerun itself writes files in the background and tells nobody when the disk is full. Each recording stream leaves a
    few idle threads behind: fine for a file a run, not for one a slider's move.
    """
    recording = rr.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()))
    content = rr.binary_stream(recording)
    try:
        recording.send_blueprint(blueprint, make_active=True, make_default=True)
        recording.send_recording_name(name)
        rr.send_chunks(list(chunks), recording=recording)
        return content.read() or b""
    finally:
        recording.disconnect()


def place_playhead(host: str, port: int, t_us: int) -> bool:
    """Put the playhead of a running viewer there, paused; False while it has not read the recording yet."""
    from rerun.experimental import ViewerClient

    try:
        viewer = ViewerClient.connect(f"rerun+http://{host}:{port}/proxy")
        state = viewer.get_state()
        if not state.recordings or state.loading:
            return False
        viewer.set_time(TIMELINE, duration=np.timedelta64(t_us * 1000, "ns"), play_state="paused")
    except (RuntimeError, OSError, ValueError):
        return False
    return True


def program() -> str:
    """Path of Rerun's own program, which comes with its package."""
    import rerun_cli  # type: ignore[import-untyped]

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return str(Path(rerun_cli.__file__).with_name(name))


def quiet_environment() -> dict[str, str]:
    """Environment for Rerun's own program in which it sends no usage data; the user's settings of Rerun stay untouched.

    Rerun sends none on a build server, which it recognises by CI; RERUN_APP_ONLY skips its welcome.
    """
    environment = {**os.environ, "CI": "true", "RERUN_APP_ONLY": "true", "RUST_LOG": "error"}
    environment.pop("FORCE_RERUN_ANALYTICS", None)
    return environment
