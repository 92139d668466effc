"""Two runs in one recording, and the page's blueprint with a tab for them."""

from __future__ import annotations

from spinscope.app.viewer import entities
from spinscope.app.viewer.comparison import compared, note_with_a
from spinscope.app.viewer.drawers import run_chunks
from spinscope.app.viewer.rrd import layout_bytes, rrd_bytes
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.views import views


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


def test_the_page_has_a_tab_for_two_runs_only_where_there_can_be_two(flight: ViewedRun) -> None:
    labels = ["All stages", "Tracker", "Logo and flow", "Spin", "Compare", "Coach"]
    assert [view.label for view in views(compare=True)] == labels
    assert [view.label for view in views()] == [label for label in labels if label != "Compare"]
    for tab in ("", "Coach", "nothing"):
        assert layout_bytes(flight, tab).startswith(b"RRF2")
