"""The examples of the documentation run as they stand."""

from __future__ import annotations

import json
import re
import runpy
import sys
from pathlib import Path

import matplotlib
import pytest

import spinscope

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
SAMPLE = ROOT / "sample_recordings" / "flight_fast_top.h5"


@pytest.fixture(autouse=True)
def _no_windows() -> None:
    matplotlib.use("agg")


def test_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    figure = tmp_path / "track.png"
    monkeypatch.setattr(sys, "argv", ["estimate.py", str(SAMPLE), str(figure)])
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


@pytest.mark.parametrize("page", ["README.md", "docs/getting_started.md"])
def test_python_on_pages(page: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Blocks run in the root of a checkout; the columns of one's own events are a sample's."""
    monkeypatch.chdir(ROOT)
    events = spinscope.open_recording(SAMPLE).read()
    namespace: dict[str, object] = {name: getattr(events, name) for name in ("t_us", "x_px", "y_px", "on")}
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), namespace)
    assert "contrast" in capsys.readouterr().out
