"""What the tuner's page shows in the embedded viewer: a run, or two runs A and B, as the bytes of an .rrd.

A slider's move makes a new recording of the same application, so that the viewer keeps its layout. What a stage
looks like is drawn again only when something above it changed.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import ChunkStore

from . import entities as at
from .ball import ball_chunks
from .layouts import NAMES, blueprint
from .painting import painting_chunks
from .rerun_api import Chunk, columns_at, once, styled
from .run import ViewedRun
from .score import score_chunks
from .stages import STAGES
from .summary import summary_chunks

Drawer = Callable[[ViewedRun], list[Chunk]]

A = "/A"
COMPARED = "/compare"
COMPARE_NAME = "Compare"
KEPT_BYTES = 90_000_000  # some thirty settings of a flight of 100 ms
# Series of A are drawn in the colour of the same series of B, mixed with this.
PALE, PALENESS = (235, 235, 235), 0.55

COLOUR_WORDS = (
    "truth violet, Kalman filter green, refined circle orange, Hough yellow; spin by triplet orange, by normal_flow "
    "blue-green, by contrast pink, rhythm of the event rate light green"
)

# Each drawer with the last stage whose results it shows: what comes later cannot change its picture.
DRAWERS: tuple[tuple[Drawer, str], ...] = (
    *zip(STAGES, ("filter", "surface", "track", "logo", "rate", "flow", "contrast"), strict=True),
    (score_chunks, "contrast"),
    (ball_chunks, "contrast"),
    (painting_chunks, "contrast"),
    (summary_chunks, "contrast"),
)


class Drawings:
    """Chunks already made, by what they show; shared by threads. The oldest go when there are too many."""

    def __init__(self, budget_bytes: int = KEPT_BYTES) -> None:
        self._budget_bytes = budget_bytes
        self._made: OrderedDict[Hashable, Future[list[Chunk]]] = OrderedDict()
        self._sizes: dict[Hashable, int] = {}
        self._lock = threading.Lock()
        self._threads = ThreadPoolExecutor(2, "drawing")

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown(cancel_futures=True)

    def begin(self, run: ViewedRun, keys: Mapping[str, Hashable]) -> None:
        """Draw what is known already of a run whose last stages are still to come, while they are computed."""
        for drawer, stage, key in _wanted(run, keys):
            if run.ticks[0].get(stage) is not None:
                self._drawn(drawer, run, key)

    def chunks(self, run: ViewedRun, keys: Mapping[str, Hashable]) -> list[Chunk]:
        """Everything there is to see of a run.

        keys : what each stage's results were made from; what comes from the same looks alike
        """
        # The ball and the words take longest, each in its own thread; numpy, OpenCV and Pillow let go of Python.
        last_first = [self._drawn(drawer, run, key) for drawer, _, key in reversed(_wanted(run, keys))]
        return [chunk for drawn in reversed(last_first) for chunk in drawn.result()]

    def keep_budget(self) -> None:
        """Forget what was not asked for longest. For when nobody waits: the sizes take a tenth of the drawing."""
        with self._lock:
            new = [(key, drawn) for key, drawn in self._made.items() if key not in self._sizes and _is_there(drawn)]
        sizes = {key: sum(chunk.to_record_batch().nbytes for chunk in drawn.result()) for key, drawn in new}
        with self._lock:
            self._sizes |= {key: size for key, size in sizes.items() if key in self._made}
            total = sum(self._sizes.values())
            for old in [key for key in self._made if key in self._sizes][:-1]:
                if total <= self._budget_bytes:
                    break
                total -= self._sizes.pop(old)
                del self._made[old]

    def _drawn(self, drawer: Drawer, run: ViewedRun, key: Hashable) -> Future[list[Chunk]]:
        with self._lock:
            drawn = self._made.get(key)
            if drawn is None or (drawn.done() and not _is_there(drawn)):
                drawn = self._made[key] = self._threads.submit(drawer, run)
            self._made.move_to_end(key)
            return drawn


def _is_there(drawn: Future[list[Chunk]]) -> bool:
    return drawn.done() and not drawn.cancelled() and drawn.exception() is None


def _wanted(run: ViewedRun, keys: Mapping[str, Hashable]) -> list[tuple[Drawer, str, Hashable]]:
    """Each drawer with its stage, and what tells its drawing from all others."""
    return [
        (drawer, stage, (number, len(run.ticks), keys[stage], run.ticks[0].get(stage) is None))
        for number, (drawer, stage) in enumerate(DRAWERS)
    ]


def compared(a: Sequence[Chunk]) -> list[Chunk]:
    """The chunks of run A beside those of run B: under the prefix /A, paler, and named "A: ..." in plots."""
    own = [chunk for chunk in a if not (chunk.entity_path.startswith(at.PLOT) and "truth" in chunk.entity_path)]
    moved = [chunk.with_entity_path(A + chunk.entity_path) for chunk in own]
    return [
        *moved,
        *(_pale(chunk) for chunk in moved if chunk.is_static and chunk.entity_path.startswith(f"{A}/plots")),
    ]


def _pale(style: Chunk) -> Chunk:
    """The style of a series, laid over its own: what is written later holds."""
    batch = style.to_record_batch()
    names = {field.name.split(":")[-1]: field.name for field in batch.schema}
    archetype = next(name.split(":")[0] for name in batch.schema.names if ":" in name)
    name = batch.column(names["names"])[0].as_py()[0]
    colour = batch.column(names["colors"])[0].as_py()[0] >> 8
    parts = [(colour >> shift) & 255 for shift in (16, 8, 0)]
    pale = [round(part + PALENESS * (light - part)) for part, light in zip(parts, PALE, strict=True)]
    made = getattr(rr, archetype).from_fields(names=f"A: {name}", colors=[(*pale, 255)])
    return once(style.entity_path, made)


def rrd_bytes(chunks: Sequence[Chunk], recording_id: str) -> bytes:
    """The chunks as one recording of this id, without a layout."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        ChunkStore.from_chunks(list(chunks)).write_rrd(path, application_id=at.APPLICATION, recording_id=recording_id)
        return path.read_bytes()


def layout_bytes(run: ViewedRun, tab: str) -> bytes:
    """The blueprint of the page's viewer: the tabs of every viewer, and one for A beside B.

    tab : the name of the one in front; the first one when there is none of that name
    """
    made = blueprint(run, "all", is_lasting=True)
    tabs = list(made.root_container.contents)
    tabs.insert(len(tabs) - 1, _compare(run))
    made.root_container.contents = tabs
    made.root_container.active_tab = tab_names().index(tab) if tab in tab_names() else 0
    with TemporaryDirectory() as folder:
        path = Path(folder) / "page.rbl"
        made.save(at.APPLICATION, path)
        return path.read_bytes()


def tab_names() -> list[str]:
    """The names of the tabs, in order."""
    names = list(NAMES.values())
    return [*names[:-1], COMPARE_NAME, names[-1]]


def note_without_a(run: ViewedRun) -> list[Chunk]:
    """What the Compare tab says while nothing is pinned."""
    text = "## Nothing to compare yet\n\nPress **Pin as A** beside the viewer, then go on turning knobs: that is B."
    return _note(run, text)


def note_with_a(run: ViewedRun, text: str) -> list[Chunk]:
    """The Compare tab's words about A and B, and which colour is which curve."""
    return _note(run, f"{text}\n\nCurves: {COLOUR_WORDS}. A is paler.")


def _note(run: ViewedRun, text: str) -> list[Chunk]:
    times = run.times_us[:1]
    return [
        columns_at(COMPARED, times, rr.TextDocument.columns(text=[text])),
        styled(COMPARED, rr.TextDocument, media_type="text/markdown"),
    ]


def _compare(run: ViewedRun) -> rrb.Container:
    """A's and B's pictures side by side, their curves in the same plots."""
    return rrb.Vertical(
        rrb.Horizontal(
            _picture(run, A, "A: surface and circles"),
            _picture(run, "", "B: surface and circles"),
            _still(A, "A: logo with the spin taken out"),
            _still("", "B: logo with the spin taken out"),
            column_shares=[3, 3, 2, 2],
        ),
        rrb.Horizontal(
            _plots("x", "x [px], A pale"),
            _plots("radius", "Radius [px], A pale"),
            _plots("spin", "Spin [rps], A pale"),
            rrb.TextDocumentView(origin=COMPARED, name="What differs"),
            column_shares=[3, 3, 3, 2],
        ),
        name=COMPARE_NAME,
    )


def _picture(run: ViewedRun, prefix: str, name: str) -> rrb.View:
    half = 2.4 * run.largest_radius_px
    circles = [prefix + path for path in (at.SURFACE, at.HOUGH, at.MEASURED, at.KALMAN, at.TRUE_CIRCLE)]
    return rrb.Spatial2DView(
        origin=prefix + at.BALL_PLACE,
        contents=circles,
        name=name,
        background=at.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-half, half], y_range=[-half, half]),
    )


def _still(prefix: str, name: str) -> rrb.View:
    return rrb.Spatial2DView(origin=prefix + at.STILL_LOGO, name=name, background=at.BACKGROUND)


def _plots(quantity: str, name: str) -> rrb.View:
    path = f"{at.PLOT}/{quantity}"
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"{path}/**", f"{A}{path}/**"],
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(visible=False),  # of twice the usual curves it would hide the plot
    )
