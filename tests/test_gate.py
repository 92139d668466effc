"""The house rules that tools can check: style, types and the arrows between the rooms."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent


@pytest.mark.parametrize(
    "command",
    [["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"], ["lint-imports"]],
    ids=["ruff", "format", "types", "layers"],
)
def test_tool_is_content(command: list[str]) -> None:
    done = subprocess.run([BIN / command[0], *command[1:]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


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


def test_nothing_but_the_design_card_stands_at_the_top() -> None:
    allowed = {"app", "pipeline", "sample_recordings", "tests", "docs", "pyproject.toml", "README.md"}
    allowed |= {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE"}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    tops = {line.split("/")[0] for line in tracked.splitlines() if not line.startswith(".")}
    assert tops <= allowed
