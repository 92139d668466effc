"""The documentation builds without warnings and holds every public name and every parameter."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import spinscope
from spinscope.pipeline.registry import Parameters

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the built pages; every warning is an error."""
    folder = tmp_path_factory.mktemp("documentation")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", str(DOCS), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_api_page_has_every_public_name(built: Path) -> None:
    page = (built / "api.html").read_text(encoding="utf-8")
    assert [name for name in spinscope.__all__ if f'id="spinscope.{name}"' not in page] == []


def test_stages_page_has_every_parameter(built: Path) -> None:
    page = (built / "stages.html").read_text(encoding="utf-8")
    groups = Parameters.group_types().items()
    names = [f"{group}.{field}" for group, parameters in groups for field in parameters.tunables()]
    assert [name for name in names if f">{name}<" not in page] == []


def test_pages_load_nothing_from_other_hosts(built: Path) -> None:
    page = (built / "index.html").read_text(encoding="utf-8")
    assert 'src="http' not in page
    assert 'rel="stylesheet" href="http' not in page
