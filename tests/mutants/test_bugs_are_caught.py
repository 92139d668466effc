"""Realistic bugs all over the tree, planted one by one: the tests find nine of ten."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants.bugs import MUTANTS
from tests.mutants.mutation import ROOT, Copy, report


def test_every_bug_can_be_planted_in_one_way() -> None:
    assert [str(mutant) for mutant in MUTANTS if mutant.times_found != 1] == []
    assert len(MUTANTS) >= 60 and len(set(map(str, MUTANTS))) == len(MUTANTS)
    missing = {test for mutant in MUTANTS for test in mutant.tests.split() if test.startswith("tests/")}
    assert sorted(test for test in missing if not (ROOT / test.partition("::")[0]).exists()) == []


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree in which all these tests pass, and in which numba has compiled what they need."""
    tests = sorted({test for mutant in MUTANTS for test in mutant.tests.split() if test.startswith("tests/")})
    copy = Copy(tmp_path_factory.mktemp("sound") / "tree")
    done = copy.run(" ".join(tests), longest_s=1800.0)
    assert done.returncode == 0, done.stdout[-3000:]
    return copy.root


@pytest.mark.slow
def test_nine_of_ten_bugs_are_caught(sound: Path) -> None:
    assert len(report(MUTANTS, sound)) <= 0.1 * len(MUTANTS)
