"""Realistic bugs, one at a time, each with the tests that ought to notice it."""

from __future__ import annotations

from . import app, pipeline, recordings, spin

MUTANTS = [*pipeline.MUTANTS, *spin.MUTANTS, *recordings.MUTANTS, *app.MUTANTS]
