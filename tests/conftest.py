"""Fixtures, options and workers of all tests.

A run of everything has three workers on two cores, for browsers and limits of time leave a core idle. Numba keeps
machine code beside the sources: what one of them compiles, the others wait for and load. So that they need not wait,
one begins with the file that compiles most and the others with files that need hardly any kernel. Files with a browser,
which waits more than it computes, come one by one among the others, and no file that takes long comes near the end,
where the other workers would wait for it.
"""

from __future__ import annotations

import gc
import os
import sys
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# Kernels compile inside the first example. The gate tries the same examples every time; a developer others each time.
settings.register_profile("spinscope", deadline=None, max_examples=50, derandomize=bool(os.environ.get("CI")))
settings.load_profile("spinscope")

SAMPLES = Path(__file__).parents[1] / "sample_recordings"
WORKERS = 3
OTHERS_BETWEEN = 4  # files between two with a browser
FIRST = (
    "pipeline/stages/test_contract.py",  # compiles all kernels of the stages
    "pipeline/recordings/test_recordings_fuzz.py",
    "test_gate.py",
    "app/coach/test_page.py",
    "app/coach/test_page_access.py",
    "pipeline/test_isolation.py",
    "pipeline/evaluation/test_suites.py",  # this one and those below take long, though of few tests
    "app/test_batch.py",
    "docs/test_build.py",
    "docs/test_examples.py",
    "pipeline/calibration/test_camera_calibration.py",
    "pipeline/calibration/test_stereo_calibration.py",
)


@pytest.fixture(scope="session")
def samples() -> Path:
    """The folder of the recordings that ship with the repository."""
    return SAMPLES


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Several workers for a run of everything; none where files are named, so that a single test starts at once."""
    if config.args_source == pytest.Config.ArgsSource.TESTPATHS and "slow" not in config.option.markexpr.split()[:1]:
        return WORKERS
    config.option.dist = "no"
    return 0


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Have each worker import from another place on, so that it finds byte code that the others have compiled."""
    report = yield
    if isinstance(collector, pytest.Directory) and (worker := os.environ.get("PYTEST_XDIST_WORKER")):
        start = len(report.result) * int(worker.removeprefix("gw")) // WORKERS
        report.result = report.result[start:] + report.result[:start]
    return report


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files named in FIRST first, then those with most tests; spread those with a browser among them."""
    folder = Path(__file__).parent
    rank = {folder / name: number for number, name in enumerate(FIRST)}
    count = Counter(item.path for item in items)
    files = sorted(count, key=lambda path: (rank.get(path, len(rank)), -count[path], path))
    browsers = {item.path for item in items if item.get_closest_marker("browser")} - rank.keys()
    place: dict[Path, float] = {path: at for at, path in enumerate(path for path in files if path not in browsers)}
    for number, path in enumerate((path for path in files if path in browsers), start=1):
        place[path] = len(rank) + number * OTHERS_BETWEEN - 0.5
    items.sort(key=lambda item: place[item.path])


def pytest_configure(config: pytest.Config) -> None:
    """Let workers and child processes share byte code."""
    if sys.dont_write_bytecode and (cache := getattr(config, "cache", None)):
        _share_bytecode(cache.mkdir("bytecode"))


def pytest_collection_finish() -> None:
    """Spare what is collected by now the search for garbage: it takes a sixth of the time that kernels compile in."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say how to run what was left out."""
    left_out = terminalreporter.stats.get("deselected", ())
    if terminalreporter.config.option.markexpr == "not slow" and any("slow" in item.keywords for item in left_out):
        terminalreporter.write_line("tests marked slow were left out: uv run pytest -m slow")


def _share_bytecode(folder: Path) -> None:
    """Keep byte code in pytest's cache where none is wanted beside the sources; without it, an import takes 2 s."""
    sys.dont_write_bytecode, sys.pycache_prefix = False, str(folder)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder)
