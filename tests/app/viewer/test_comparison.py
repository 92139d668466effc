"""Two runs in one recording, and the page's blueprint with a tab for them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from spinscope.app.viewer import entities
from spinscope.app.viewer.comparison import compared, comparison, difference_chunks, note_with_a, note_without_a
from spinscope.app.viewer.drawers import run_chunks
from spinscope.app.viewer.entities import COMPARED_AXES, NO_DIFFERENCE, OFF, ON, SURFACE_DIFFERENCE
from spinscope.app.viewer.rrd import layout_bytes, rrd_bytes
from spinscope.app.viewer.run import ViewedRun, shown_estimate, vector_of
from spinscope.app.viewer.views import views
from spinscope.pipeline.tick import Tick

from .conftest import with_results
from .reading import Rows, read_back


def test_a_stands_beside_b_with_names_of_its_own(flight: ViewedRun) -> None:
    chunks = run_chunks(flight)
    both = [*chunks, *compared(chunks)]
    paths = {chunk.entity_path for chunk in both}
    assert f"/A{entities.SURFACE}" in paths
    assert f"/A{entities.SPIN_MAGNITUDE}/contrast" in paths
    assert not [path for path in paths if path.startswith("/A/plots") and "truth" in path]
    assert len(rrd_bytes(both, "both")) > 1.5 * len(rrd_bytes(chunks, "one"))


def test_the_note_names_every_methods_colour(flight: ViewedRun) -> None:
    note = note_with_a(flight, "## A and B")[0].to_record_batch()
    (column,) = [note.column(name) for name in note.schema.names if name.endswith("text")]
    ((text,),) = column.to_pylist()
    for words in ("Triplet Matching orange", "Normal flow cyan", "Contrast maximisation pink", "truth violet"):
        assert words in text


def test_panes_that_need_a_say_how_to_pin_it(flight: ViewedRun, tmp_path: Path) -> None:
    path = tmp_path / "without.rrd"
    path.write_bytes(rrd_bytes([*run_chunks(flight), *note_without_a(flight)], "without"))
    found = read_back(path)
    panes = [view for view in _views(comparison(flight)) if type(view).__name__.startswith("Spatial")]
    for pane in panes:
        contents = [pane.contents] if isinstance(pane.contents, str) else pane.contents
        paths = {one.replace("$origin", str(pane.origin)).removesuffix("/**") for one in contents}
        shown = [name for name in found if any(name == path or name.startswith(f"{path}/") for path in paths)]
        assert shown, f"{pane.name} has no data"
        assert any(name.startswith(str(pane.origin)) for name in found), f"{pane.name} has no origin"


def _views(part: Any) -> list[Any]:
    """All views of a layout."""
    return [view for one in part.contents for view in _views(one)] if isinstance(part, rrb.Container) else [part]


def test_the_page_has_a_tab_for_two_runs_only_where_there_can_be_two(flight: ViewedRun) -> None:
    labels = ["All stages", "Tracker", "Logo and flow", "Spin", "Compare", "Coach"]
    assert [view.label for view in views(compare=True)] == labels
    assert [view.label for view in views()] == [label for label in labels if label != "Compare"]
    for tab in ("", "Coach", "nothing"):
        assert layout_bytes(flight, tab)[0].startswith(b"RRF2")


def logged(a: ViewedRun, b: ViewedRun, folder: Path) -> dict[str, Rows]:
    """What shows the differences of two runs, read back."""
    path = folder / "compared.rrd"
    path.write_bytes(rrd_bytes(difference_chunks(a, b), "compared"))
    return read_back(path)


def decoded(blobs: Any) -> NDArray[np.generic]:
    """The only picture of a row, RGB."""
    (blob,) = blobs
    picture = cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture[..., ::-1]


def test_equal_runs_differ_nowhere(flight: ViewedRun, tmp_path: Path) -> None:
    found = logged(flight, flight, tmp_path)
    pictures = [decoded(blobs) for blobs in found[SURFACE_DIFFERENCE].values["blob"]]
    assert len(pictures) == len(flight.times_us) and not any(picture.any() for picture in pictures)
    notes = [list(row) if row is not None else [] for row in found[NO_DIFFERENCE].values["labels"]]
    assert notes == [[]] + [["no difference"]] * len(flight.ticks)
    angles = {label for row in found[f"{COMPARED_AXES}/angle"].values["labels"] for label in row or ()}
    assert angles == {"0.0°"}
    arrows = [found[f"{COMPARED_AXES}/{name}"].values["vectors"] for name in "AB"]
    first, second = (np.array([row[0] for row in rows if row]) for rows in arrows)
    assert len(first) > 10 and f"{COMPARED_AXES}/truth" in found
    assert np.allclose(np.cross(first, second), 0, atol=1e-6) and (first * second).sum(axis=1).min() > 1


def test_what_one_surface_lacks_has_the_others_colour(flight: ViewedRun, tmp_path: Path) -> None:
    def dark(tick: Tick) -> Tick:
        return with_results(tick, surface=dataclasses.replace(tick.surface, levels=np.zeros_like(tick.surface.levels)))

    darkened = dataclasses.replace(flight, ticks=[dark(tick) for tick in flight.ticks])
    for a, b, colour in ((flight, darkened, OFF), (darkened, flight, ON)):
        found = logged(a, b, tmp_path)
        picture = decoded(found[SURFACE_DIFFERENCE].at("blob", int(flight.opening_us)))
        assert not len(found[NO_DIFFERENCE].at("labels", int(flight.opening_us)))
        brightest = picture.reshape(-1, 3)[picture.sum(axis=2).argmax()]
        assert brightest.max() > 100 and np.allclose(
            brightest / brightest.max(), np.divide(colour, max(colour)), atol=0.02
        )


def test_the_angle_between_the_axes_is_told(flight: ViewedRun, spinner: ViewedRun, tmp_path: Path) -> None:
    row = next(i for i, tick in enumerate(flight.ticks) if tick.best is not None)
    at_us = int(flight.ends_us[row])
    before = spinner.ticks[int(np.searchsorted(spinner.ends_us, at_us, side="right")) - 1]
    first, last = (vector_of(shown_estimate(tick)[0]) for tick in (before, flight.ticks[row]))
    angle_deg = np.degrees(np.arccos(first @ last / np.linalg.norm(first) / np.linalg.norm(last)))
    found = logged(spinner, flight, tmp_path)[f"{COMPARED_AXES}/angle"]
    assert found.at("labels", at_us) == [f"{angle_deg:.1f}°"] and angle_deg > 1
    ((strip,),) = (found.at("strips", at_us),)
    assert np.allclose(np.linalg.norm(strip, axis=1), 1) and np.allclose(strip[-1], last / np.linalg.norm(last))
