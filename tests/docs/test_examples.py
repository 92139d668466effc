"""The examples of the documentation run as they stand."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path

import matplotlib
import pytest

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@pytest.fixture(autouse=True)
def _no_windows() -> None:
    matplotlib.use("agg")


def test_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    figure = tmp_path / "track.png"
    sample = EXAMPLES.parents[1] / "sample_recordings" / "flight_fast_top.h5"
    monkeypatch.setattr(sys, "argv", ["estimate.py", str(sample), str(figure)])
    runpy.run_path(str(EXAMPLES / "estimate.py"), run_name="__main__")
    assert figure.read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert "*contrast" in printed
    assert printed.count("pad ") == 5
    assert "the same from memory: best = contrast" in printed


def test_notebook(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The code cells run in one namespace: what a kernel would do, without a process and its messages."""
    monkeypatch.chdir(EXAMPLES)
    cells = json.loads((EXAMPLES / "notebook.ipynb").read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert len(sources) >= 8
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, source in enumerate(sources):
        exec(compile(source, f"notebook.ipynb, code cell {number + 1}", "exec"), namespace)
    printed = capsys.readouterr().out
    assert "trusted: contrast" in printed
    assert printed.endswith("True\n")


def test_notebook_is_committed_without_outputs() -> None:
    cells = json.loads((EXAMPLES / "notebook.ipynb").read_text(encoding="utf-8"))["cells"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells if cell["cell_type"] == "code")
