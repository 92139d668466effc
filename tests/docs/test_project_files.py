"""Citation, issue forms and hooks are valid; what README and documentation name exists."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def _yaml(path: str) -> Any:
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_citation_has_what_the_citation_file_format_asks_for() -> None:
    """Keys of schema 1.2.0; there is no validator of it among the maintained packages."""
    citation = _yaml("CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert {"message", "title", "authors", "date-released"} <= citation.keys()
    assert all("name" in author or "family-names" in author for author in citation["authors"])
    (paper,) = citation["references"]
    assert {"type", "title", "authors", "year", "conference"} <= paper.keys()
    assert [author["family-names"] for author in paper["authors"]] == ["Gossard", "Krismer", "Ziegler", "Tebbe", "Zell"]


@pytest.mark.parametrize("name", ["bug", "feature"])
def test_issue_form(name: str) -> None:
    form = _yaml(f".github/ISSUE_TEMPLATE/{name}.yml")
    assert {"name", "description", "body"} <= form.keys()
    fields = [field["id"] for field in form["body"]]
    assert len(set(fields)) == len(fields)
    assert all(field["attributes"]["label"] for field in form["body"])
    assert all(field["type"] in ("textarea", "input", "dropdown", "checkboxes") for field in form["body"])


def test_bug_form_asks_for_info_and_version() -> None:
    fields = {field["id"]: field for field in _yaml(".github/ISSUE_TEMPLATE/bug.yml")["body"]}
    assert "spinscope info" in fields["info"]["attributes"]["description"]
    assert fields["info"]["validations"]["required"]
    assert "spinscope --version" in fields["version"]["attributes"]["description"]


def test_hooks_are_the_checks_of_the_gate() -> None:
    hooks = [hook for repo in _yaml(".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]]
    assert [hook["id"] for hook in hooks] == ["ruff-check", "ruff-format", "mypy", "lint-imports"]
    assert all(hook["entry"].startswith("uv run ") for hook in hooks)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_paths_exist(page: Path) -> None:
    """Relative links lead to files, and source paths in backticks are there."""
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", text)
    assert [link for link in links if not (page.parent / link).exists()] == []
    paths = re.findall(r"`((?:app|pipeline|tests|docs|sample_recordings|\.package|\.ci)/[\w./-]*)`", text)
    assert [path for path in paths if not (ROOT / path).exists() and path != "docs/_build/index.html"] == []


def test_notes_of_the_version_are_in_the_changelog() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_no_file_stands_where_compiled_code_is_kept() -> None:
    """Python and numba could keep none there: every start would compile anew."""
    folders = [path for name in ("app", "pipeline", "tests", "docs") for path in (ROOT / name).rglob("__pycache__")]
    assert all(path.is_dir() for path in folders)
