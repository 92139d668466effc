"""The real stages replaced by toys."""

from __future__ import annotations

import pytest

from tests.pipeline.toy_stages import Toys


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> Toys:
    """The stages replaced by toys."""
    return Toys(monkeypatch)


@pytest.fixture
def calls(toys: Toys) -> dict[str, int]:
    """How often each toy stepped."""
    return toys.counts
