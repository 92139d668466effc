"""Cache of columns: what it holds, and by which keys."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.column_cache import Column, ColumnCache, StageKey

CELLS = 100  # a result has so many, 8 bytes each
ACTIONS = st.lists(st.tuples(st.sampled_from(["more", "new", "drop", "forget"]), st.integers(0, 5)), max_size=40)


def grown(cache: ColumnCache, column: Column, *, is_kept: bool = True) -> None:
    cache.result(column, column.first + len(column.results), lambda: np.zeros(CELLS), is_kept=is_kept)


@given(actions=ACTIONS, budget=st.integers(0, 12))
def test_what_is_kept_is_within_the_budget_whatever_came_and_went(actions: list[tuple[str, int]], budget: int) -> None:
    """Counted as it comes and goes; here all columns are added up."""
    cache, used = ColumnCache(budget * 8 * CELLS, 4), dict[int, Column]()
    for action, name in actions:
        if action == "new" or name not in used:
            used[name] = cache.begun(name, 0, object)
        if action == "drop":
            cache.drop(used[name])
        else:
            grown(cache, used[name], is_kept=action != "forget")
        cache.keep_budget([])
        kept = list(cache._columns.values())
        assert len(kept) <= 4 and sum(column.bytes for column in kept) <= budget * 8 * CELLS
    cache.keep_budget([])
    room = budget - sum(len(column.results) for column in cache._columns.values())
    if len(cache._columns) < 4:  # what is left of the budget can be used: nothing that went is still counted
        last = cache.begun("last", 0, object)
        for _ in range(room):
            grown(cache, last)
        cache.keep_budget([])
        assert cache.reaches("last", room - 1) or room == 0


def test_keys_are_equal_where_their_parts_are() -> None:
    def key(value: float) -> StageKey:
        return StageKey("surface", (StageKey("filter", value),))

    assert key(1.0) == key(1.0) and hash(key(1.0)) == hash(key(1.0))
    assert key(1.0) != key(2.0) and key(1.0) != ("surface", (StageKey("filter", 1.0),))
