"""Checks of the whole tree by tools (style, types, import layers), and of the files at its top."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent


TOOLS = {
    "ruff": ["ruff", "check", "."],
    "format": ["ruff", "format", "--check", "."],
    "types": ["mypy"],
    "layers": ["lint-imports"],
}


@pytest.fixture(scope="module")
def tools() -> dict[str, subprocess.Popen[str]]:
    """All tools at work at the same time."""
    return {
        name: subprocess.Popen(
            [BIN / program, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        for name, (program, *arguments) in TOOLS.items()
    }


@pytest.mark.parametrize("name", TOOLS)
def test_tool_finds_nothing(tools: dict[str, subprocess.Popen[str]], name: str) -> None:
    said, _ = tools[name].communicate()
    assert tools[name].returncode == 0, said


def test_the_layer_check_would_notice_a_forbidden_import(tmp_path: Path) -> None:
    """The same contracts on a copy in which a kernel imports a stage must fail."""
    for package in ("app", "pipeline", ".package"):
        shutil.copytree(ROOT / package, tmp_path / package, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "pipeline/kernels/forbidden.py").write_text("from ..stages import logo as logo\n", encoding="utf-8")
    done = subprocess.run(
        [BIN / "lint-imports"],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path / ".package")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "spinscope.pipeline.kernels.forbidden" in done.stdout


def tracked_files(folder: Path) -> set[str] | None:
    """Files under version control; None in a copy of the tree that has none."""
    if not (folder / ".git").exists():
        return None
    done = subprocess.run(["git", "ls-files", "-z"], cwd=folder, capture_output=True, text=True, check=True)
    return set(done.stdout.split("\0")) - {""}


def unexpected(files: set[str]) -> set[str]:
    """Names at the top of the tree that the design card does not have there."""
    allowed = {"app", "pipeline", "sample_recordings", "tests", "docs", "pyproject.toml", "README.md"}
    allowed |= {"CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE"}
    return {top for top in (name.split("/")[0] for name in files) if not top.startswith(".")} - allowed


def test_nothing_but_the_design_card_stands_at_the_top() -> None:
    files = tracked_files(ROOT)
    if files is None:
        pytest.skip("this tree is not under version control")
    assert {"pyproject.toml", "app/cli.py", "pipeline/chain.py", "tests/test_gate.py"} <= files
    assert unexpected(files) == set()
    assert unexpected({*files, "scripts/build.sh", "setup.py"}) == {"scripts", "setup.py"}
