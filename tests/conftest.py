"""What all tests share: the sample recordings and their truth."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("spinscope", deadline=None)  # kernels compile inside the first example
settings.load_profile("spinscope")

SAMPLES = Path(__file__).parents[1] / "sample_recordings"


@pytest.fixture(scope="session")
def samples() -> Path:
    """The folder of the recordings that ship with the repository."""
    return SAMPLES
