"""No circles among the modules' imports."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]


def circles(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """Groups of modules of the import package in this folder that import each other, directly or not.

    Imports for type checkers alone do not count; those inside functions do.
    """
    monkeypatch.syspath_prepend(str(folder))
    for name in [name for name in sys.modules if name.split(".")[0] == "spinscope"]:
        monkeypatch.delitem(sys.modules, name)
    graph = grimp.build_graph("spinscope", exclude_type_checking_imports=True, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    reached: dict[str, set[str]] = {}
    for module in imports:
        found, waiting = set(), [module]
        while waiting:
            for other in imports[waiting.pop()] - found:
                found.add(other)
                waiting.append(other)
        reached[module] = found
    rounds = {frozenset(b for b in reached[a] if a in reached[b]) for a in reached if a in reached[a]}
    return sorted((set(group) for group in rounds), key=sorted)


def test_no_module_imports_itself_by_way_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    assert circles(ROOT / ".package", monkeypatch) == []


def test_a_circle_would_be_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "spinscope"
    shutil.copytree(ROOT / "pipeline/kernels", package / "kernels", ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "kernels/one.py").write_text("from . import two as two\n", encoding="utf-8")
    (package / "kernels/two.py").write_text("def late():\n    from . import one\n    return one\n", encoding="utf-8")
    assert circles(tmp_path, monkeypatch) == [{"spinscope.kernels.one", "spinscope.kernels.two"}]
