"""Numba's cache of compiled kernels: where it cannot be written, and for several processes."""

from __future__ import annotations

import os
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from subprocess import PIPE
from typing import Any

import pytest
from numba import njit
from numba.core.caching import FunctionCache, NullCache
from numba.core.dispatcher import Dispatcher

from spinscope import pipeline
from spinscope.pipeline import compilation
from spinscope.pipeline.compilation import KernelCache, MemoryCache


def doubled(value: int) -> int:
    return 2 * value


doubled.__module__ = "spinscope.kernel"


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "_warned", False)


def test_every_kernel_has_such_a_cache() -> None:
    kernels = []
    for module in pkgutil.walk_packages(pipeline.__path__, "spinscope.pipeline."):
        found = vars(import_module(module.name)).values()
        kernels += [value for value in found if isinstance(value, Dispatcher)]
    assert len(kernels) > 100
    assert {type(kernel._cache) for kernel in kernels} <= {KernelCache, MemoryCache, NullCache}


def test_a_full_disk_is_said_and_the_kernel_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    kernel = njit(cache=True)(doubled)
    monkeypatch.setattr(FunctionCache, "save_overload", full)
    with pytest.warns(UserWarning, match=r"cannot be kept \(No space left on device\).*NUMBA_CACHE_DIR") as said:
        assert kernel(4) == 8 and kernel(4.5) == 9
    assert len(said) == 1


def test_kernels_without_any_folder_to_keep_them_are_compiled_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.compilation.KernelCache._impl_class._locator_classes", [])
    kernel = njit(cache=True)(doubled)
    with pytest.warns(UserWarning, match="neither the program's folder nor the user's cache"):
        assert kernel(4) == 8


def test_kernels_of_other_packages_keep_numbas_own_cache() -> None:
    def own(value: int) -> int:
        return value

    own.__module__ = "elsewhere"
    assert type(njit(cache=True)(own)._cache) is FunctionCache


@pytest.mark.skipif(compilation.fcntl is None, reason="no locks of files")
def test_of_several_processes_one_compiles_and_the_others_load(tmp_path: Path) -> None:
    code = (
        "import spinscope.pipeline.compilation, numpy; from spinscope.pipeline.kernels.rotation import axis_and_length;"
        "input(); print(axis_and_length(numpy.zeros(3)), sum(axis_and_length.stats.cache_misses.values()))"
    )
    here = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    processes = [
        subprocess.Popen([sys.executable, "-c", code], stdin=PIPE, stdout=PIPE, text=True, env=here) for _ in range(2)
    ]
    for process in processes:  # both have loaded the compiler before either needs it
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    said = sorted(process.communicate(timeout=120)[0].strip() for process in processes)
    assert said == ["(0.0, 0.0, 1.0, 0.0) 0", "(0.0, 0.0, 1.0, 0.0) 1"]
