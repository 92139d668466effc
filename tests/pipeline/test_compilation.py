"""Numba's cache of compiled kernels where it cannot be written."""

from __future__ import annotations

import pkgutil
from importlib import import_module
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
