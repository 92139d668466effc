"""Realistic bugs, one at a time, each with the tests that ought to notice it."""

from __future__ import annotations

from . import app, pipeline, recordings, spin, stages

MUTANTS = [*pipeline.MUTANTS, *stages.MUTANTS, *spin.MUTANTS, *recordings.MUTANTS, *app.MUTANTS]
