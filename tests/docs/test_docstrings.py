"""Docstrings begin with a noun phrase or a verb, not with a relative clause; no two classes share a name."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
RELATIVE = {"what", "where", "how", "which", "who", "whose", "when", "why", "whatever", "all that", "that"}


def _trees() -> Iterator[tuple[Path, ast.Module]]:
    for folder in ("app", "pipeline"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path.relative_to(ROOT), ast.parse(path.read_text(encoding="utf-8"))


def test_no_docstring_begins_with_a_relative_clause() -> None:
    found = []
    for path, tree in _trees():
        for node in ast.walk(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
                words = (ast.get_docstring(node) or "").lower().replace("?", "").split()
                if words and (words[0] in RELATIVE or " ".join(words[:2]) in RELATIVE):
                    found.append(f"{path}:{getattr(node, 'lineno', 1)}: {' '.join(words[:8])}")
    assert not found, "\n".join(found)


def test_no_two_classes_share_a_name() -> None:
    places = defaultdict(list)
    for path, tree in _trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(f"{path}:{node.lineno}")
    shared = {name: where for name, where in places.items() if len(where) > 1}
    assert not shared, shared
