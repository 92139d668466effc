"""The committed picture shows the imports as they are."""

from __future__ import annotations

import runpy
from graphlib import CycleError
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "docs" / "architecture.py"


def test_picture_is_up_to_date() -> None:
    digest = runpy.run_path(str(SCRIPT))["digest"]()
    assert digest in SCRIPT.with_suffix(".svg").read_text(encoding="utf-8"), "run: uv run python docs/architecture.py"


def test_picture_changes_with_the_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    import grimp

    names = runpy.run_path(str(SCRIPT))
    before, graph = names["digest"](), grimp.build_graph("spinscope", cache_dir=None)
    graph.add_import(importer="spinscope.pipeline.recordings.sensor", imported="spinscope.pipeline.simulator.scene")
    monkeypatch.setattr(grimp, "build_graph", lambda *_, **__: graph)
    assert names["digest"]() != before
    assert names["draw"]().axes


def test_packages_that_import_each_other_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import grimp

    names, graph = runpy.run_path(str(SCRIPT)), grimp.build_graph("spinscope", cache_dir=None)
    graph.add_import(importer="spinscope.pipeline.kernels.eros", imported="spinscope.pipeline.stages.surface")
    monkeypatch.setattr(grimp, "build_graph", lambda *_, **__: graph)
    with pytest.raises(CycleError, match=r"pipeline\.kernels.*pipeline\.stages"):
        names["digest"]()


def test_imports_that_others_imply_are_not_drawn() -> None:
    reduced = runpy.run_path(str(SCRIPT))["_reduced"]
    assert reduced({("a", "b"), ("b", "c"), ("a", "c")}) == {("a", "b"), ("b", "c")}
