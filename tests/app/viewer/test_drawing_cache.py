"""Drawings made once: kept while what they show stays the same, and made again when it changes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from spinscope.app.viewer.drawers import DRAWERS, Drawer, run_chunks
from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.registry import quick_stages
from spinscope.pipeline.session import Choices, Result, Session


@pytest.fixture(scope="module")
def session(samples: Path) -> Session:
    return Session.open(samples / "flight_fast_top.h5", Choices())


@pytest.fixture
def cache() -> Iterator[DrawingCache]:
    cache = DrawingCache()
    yield cache
    cache.close()


def run_of(session: Session, *assignments: str, **options: Any) -> tuple[ViewedRun, Any]:
    """The run with other parameters, and its keys."""
    parameters = session.parameters.with_assignments(assignments)
    ticks = session.chain.run(parameters, **options)
    return ViewedRun.of(Result.of(session, ticks)), session.chain.keys(parameters)


def same_entities(a: list[Any], b: list[Any]) -> set[str]:
    """Paths of the entities whose chunks over time are the same objects."""
    return {chunk.entity_path for chunk in b if not chunk.is_static and any(chunk is other for other in a)}


def test_only_what_changed_is_drawn_again(session: Session, cache: DrawingCache) -> None:
    first = cache.chunks(*run_of(session))
    assert len(first) == len(run_chunks(run_of(session)[0]))
    assert all(a is b for a, b in zip(first, cache.chunks(*run_of(session)), strict=True))
    kept = same_entities(first, cache.chunks(*run_of(session, "logo.pad_px=5")))
    assert {"/image/events", "/image/surface", "/plots/x/kalman"} <= kept
    assert not {"/image/ball/logo", "/summary", "/plots/spin/contrast"} & kept


def test_a_methods_own_parameter_draws_its_curve_again(session: Session, cache: DrawingCache) -> None:
    """Contrast comes after it but does not read it."""
    first = cache.chunks(*run_of(session))
    kept = same_entities(first, cache.chunks(*run_of(session, "spin.triplet_solve=least_squares")))
    assert {"/image/events", "/image/ball/flow"} <= kept
    assert not {"/plots/spin/triplet", "/summary"} & kept


def test_what_is_drawn_early_is_drawn_once(session: Session, cache: DrawingCache) -> None:
    run, keys = run_of(session, "logo.pad_px=3.7", targets=quick_stages())
    assert "contrast" not in run.stages
    cache.begin(run, keys)
    early = cache.chunks(run, keys)
    whole = cache.chunks(*run_of(session, "logo.pad_px=3.7"))
    kept = same_entities(early, whole)
    assert {"/image/events", "/image/surface", "/image/ball/logo"} <= kept
    assert not {path for path in kept if "contrast" in path or path.startswith("/world")}
    assert not [chunk for chunk in early if chunk.entity_path.startswith("/score")]


def test_the_oldest_go_when_the_budget_is_spent(session: Session) -> None:
    cache = DrawingCache(budget_bytes=1)
    try:
        assert cache.chunks(*run_of(session))
        cache.keep_budget()
        assert len(cache._drawings) == 1
    finally:
        cache.close()


def test_a_drawing_that_fails_is_tried_again(session: Session, cache: DrawingCache) -> None:
    fails = iter([True, False])

    def broken(_: ViewedRun) -> list[Any]:
        if next(fails):
            raise ValueError("no paint")
        return []

    with DRAWERS.registered(Drawer(name="broken", stage="filter", draw=broken)):
        with pytest.raises(ValueError, match="no paint"):
            cache.chunks(*run_of(session))
        assert cache.chunks(*run_of(session))


def test_a_drawer_needs_no_more_than_the_stages_that_were_run(session: Session) -> None:
    for targets in ((), ("filter",), ("track",), ("logo",), ("flow",), ("triplet",), ("normal_flow",)):
        run, _ = run_of(session, targets=(*targets, "track"))
        assert run_chunks(run), targets
