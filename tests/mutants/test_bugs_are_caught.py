"""Realistic bugs all over the tree, planted one by one: the tests find nine of ten."""

from __future__ import annotations

import pytest

from tests.mutants.bugs import MUTANTS
from tests.mutants.mutation import ROOT, Copy, report

pytestmark = pytest.mark.slow


def test_every_bug_can_be_planted_in_one_way() -> None:
    assert [str(mutant) for mutant in MUTANTS if mutant.times_found != 1] == []
    assert len(MUTANTS) >= 60 and len(set(map(str, MUTANTS))) == len(MUTANTS)
    missing = {test for mutant in MUTANTS for test in mutant.tests.split() if test.startswith("tests/")}
    assert sorted(test for test in missing if not (ROOT / test.partition("::")[0]).exists()) == []


def test_the_tests_pass_where_no_bug_is_planted(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Else every bug would seem to be caught."""
    tests = sorted({test for mutant in MUTANTS for test in mutant.tests.split() if test.startswith("tests/")})
    done = Copy(tmp_path_factory.mktemp("mutants") / "tree").run(" ".join(tests))
    assert done.returncode == 0, done.stdout[-3000:]


def test_nine_of_ten_bugs_are_caught() -> None:
    assert len(report(MUTANTS)) <= 0.1 * len(MUTANTS)
