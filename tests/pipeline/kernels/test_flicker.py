"""Lamp flicker: what comes again in every period goes, what passes by stays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import flicker
from tests.columns import read_only
from tests.reference.filter import NaiveFlicker


def recurring(columns, flicker_hz, cuts=()):
    """The kernel over these columns on a sensor of 8 x 4 pixels, cut into packets."""
    history = flicker.empty_history(32)
    pieces = np.split(np.arange(columns[0].size), list(cuts))
    found = [flicker.recurring(history, 8, read_only(*(c[piece] for c in columns)), flicker_hz) for piece in pieces]
    return np.concatenate(found)


@given(
    count=st.integers(0, 400),
    pixels=st.integers(1, 8),
    period_share=st.floats(0.0, 1.0),
    flicker_hz=st.sampled_from([100, 120]),
    start_us=st.integers(0, 1_700_000_000_000_000),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_stream_equals_the_twin(count, pixels, period_share, flicker_hz, start_us, seed):
    """Random events, a share of them near multiples of the period."""
    rng = np.random.default_rng(seed)
    t = rng.integers(0, 80_000, count)
    period_us = 1e6 / flicker_hz
    near = rng.random(count) < period_share
    t[near] = (np.rint(t[near] / period_us) * period_us + rng.normal(0, 600, near.sum())).clip(0).astype(np.int64)
    t = np.sort(t) + start_us
    x, y = rng.integers(0, pixels, count).astype(np.uint16), rng.integers(0, 2, count).astype(np.uint16)
    on = rng.random(count) < 0.5
    twin = NaiveFlicker(flicker_hz)
    expected = [twin.is_flicker(*event) for event in zip(t.tolist(), x.tolist(), y.tolist(), on.tolist(), strict=True)]
    assert recurring((t, x, y, on), flicker_hz, cuts=(count // 3, count // 2)).tolist() == expected


@pytest.mark.parametrize("flicker_hz", [100, 120])
def test_a_lamp_is_removed_from_its_third_period_on_and_another_rate_stays(flicker_hz):
    period_us = 1e6 / flicker_hz
    beats = np.rint(np.arange(12) * period_us).astype(np.int64)
    t = np.sort(np.concatenate([beats + 500, beats + 5500]))  # ON on the way up, OFF on the way down
    on = np.arange(t.size) % 2 == 0
    zeros = np.zeros(t.size, np.uint16)
    assert recurring((t, zeros, zeros, on), flicker_hz).tolist() == [False] * 4 + [True] * 20
    for other_hz in (60, 85, 130):
        t = np.rint(np.arange(24) * 1e6 / other_hz).astype(np.int64)
        assert not recurring((t, zeros, zeros, on | True), flicker_hz).any()
