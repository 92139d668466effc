"""Contrast after a change of parameters that leaves the logo's events as they are: known, not computed again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session
from spinscope.pipeline.spin.contrast import stage

CALLED = ("estimate_spin", "follow_spin", "estimates_of_ends", "score_map")
# Parameters of other stages, and changes after which their results differ, but hardly.
CHANGES: dict[str, dict[str, Any]] = {
    "logo": {"pad_px": 2.51},
    "filter": {"threshold_us": 5010},
    "spin": {"max_spin_rps": 149.5},
}


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the slow functions, as often as they are called."""
    names: list[str] = []

    def counted(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            names.append(function.__name__)
            return function(*arguments, **options)

        return call

    for name in CALLED:
        monkeypatch.setattr(stage, name, counted(getattr(stage, name)))
    return names


def results(session: Session, parameters: Parameters) -> list[dict[str, Any]]:
    """What contrast says, tick by tick."""
    ticks = session.chain.run(parameters, ("contrast",))
    return [dataclasses.asdict(ball.results["contrast"]) for tick in ticks for ball in tick.balls]


@pytest.mark.parametrize("group", CHANGES)
def test_it_is_known_to_the_last_bit_where_only_its_start_moves(samples: Path, called: list[str], group: str) -> None:
    changed = Parameters().with_values({group: CHANGES[group]})
    session, fresh = (Session.open(samples / "flight_fast_top.h5") for _ in range(2))
    results(session, session.parameters)
    assert set(called) == set(CALLED)
    called.clear()
    known = results(session, changed)
    assert called == []
    made = results(fresh, changed)
    assert set(called) == set(CALLED)
    np.testing.assert_equal(known, made)
