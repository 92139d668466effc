"""Planting of bugs, one at a time, in a copy of the tree, to see whether the tests that ought to notice do.

`uv run pytest -m slow tests/mutants` does it for all of them; `uv run python -m tests.mutants.mutation WORD ...` for
those whose file, text or tests hold one of the words.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Literal

ROOT = Path(__file__).parents[2]
LEFT_OUT = (".git", ".venv", ".hypothesis", ".benchmarks", ".pytest_cache", ".mypy_cache", ".ruff_cache")
LONGEST_S = 300.0  # tests that take longer may hang by the bug or not: it does not count as caught

Verdict = Literal["caught", "survived", "endless", "invalid"]


@dataclass(frozen=True, slots=True)
class Mutant:
    """One realistic bug.

    Attributes
    ----------
    file : str
        File of the tree, relative to its root.
    old, new : str
        Text that stands there exactly once, and what takes its place.
    tests : str
        Arguments of pytest, separated by blanks: what ought to notice.
    """

    file: str
    old: str
    new: str
    tests: str

    def __str__(self) -> str:
        return f"{self.file}: {' '.join(self.old.split())}  ->  {' '.join(self.new.split()) or '(nothing)'}"

    @property
    def times_found(self) -> int:
        """How often the old text stands in the file; 0 where there is no such file."""
        path = ROOT / self.file
        return path.read_text(encoding="utf-8").count(self.old) if path.exists() else 0


class Copy:
    """A copy of a tree in a folder of its own, with what numba has compiled already.

    Numba keeps machine code beside the sources and looks at the time stamp of its own source file only. So what was
    compiled of a changed module goes, and of all that import it, for callers hold the code of what they call.
    """

    def __init__(self, folder: Path, origin: Path = ROOT) -> None:
        self.root = folder
        shutil.copytree(origin, folder, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))
        self.environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV_"))},
            "PYTHONPATH": str(folder / ".package"),
            "PYTHONDONTWRITEBYTECODE": "1",  # stamps of a second are too coarse for changes that follow each other
        }

    def run(self, tests: str, longest_s: float = LONGEST_S) -> subprocess.CompletedProcess[str]:
        """Run some tests up to the first failure; raises TimeoutExpired."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests.split()]
        return subprocess.run(
            command, cwd=self.root, env=self.environment, capture_output=True, text=True, check=False, timeout=longest_s
        )

    def verdict(self, mutant: Mutant) -> tuple[Verdict, str]:
        """Plant the bug, run its tests and put the tree back; what came of it, and the end of what the tests said."""
        path = self.root / mutant.file
        text, stamp = path.read_text(encoding="utf-8"), path.stat().st_mtime_ns
        compiled = {file: file.read_bytes() for file in self._compiled_with(path)}
        path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        for file in compiled:
            file.unlink()
        try:
            done = self.run(mutant.tests)
        except subprocess.TimeoutExpired:
            return "endless", f"no end within {LONGEST_S:g} s"
        finally:
            for file in self._compiled_with(path):
                file.unlink()
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(stamp, stamp))
            for file, code in compiled.items():
                file.write_bytes(code)
        verdicts: dict[int, Verdict] = {0: "survived", 1: "caught"}
        return verdicts.get(done.returncode, "invalid"), done.stdout[-1500:] + done.stderr[-500:]

    def _compiled_with(self, path: Path) -> Iterator[Path]:
        """Files of machine code of a module and of all that import it, directly or through others."""
        sources = {file: file.read_text(encoding="utf-8") for top in ("app", "pipeline") for file in self._modules(top)}
        changed, names = {path}, {path.stem}
        if "njit" not in sources.get(path, ""):
            return
        while names:
            imports = re.compile(rf"^\s*(?:from|import)\b.*\b(?:{'|'.join(map(re.escape, names))})\b", re.MULTILINE)
            found = {file for file, text in sources.items() if file not in changed and imports.search(text)}
            found = {file for file in found if "njit" in sources[file]}
            changed |= found
            names = {file.stem for file in found}
        for file in changed:
            yield from (file.parent / "__pycache__").glob(f"{file.stem}.*.nb[ic]")

    def _modules(self, top: str) -> Iterable[Path]:
        return (self.root / top).rglob("*.py")


def plant_all(mutants: Sequence[Mutant], origin: Path, workers: int) -> Iterator[tuple[Mutant, Verdict, str, float]]:
    """Plant every mutant in one of several copies; yields each with its verdict, what was said, and seconds."""
    with tempfile.TemporaryDirectory() as folder:
        idle: SimpleQueue[Copy] = SimpleQueue()
        for number in range(workers):
            idle.put(Copy(Path(folder) / f"copy{number}", origin))

        def judged(mutant: Mutant) -> tuple[Mutant, Verdict, str, float]:
            copy, begin = idle.get(), time.perf_counter()
            try:
                return mutant, *copy.verdict(mutant), time.perf_counter() - begin
            finally:
                idle.put(copy)

        with ThreadPoolExecutor(workers) as pool:
            for done in as_completed([pool.submit(judged, mutant) for mutant in mutants]):
                yield done.result()


def report(mutants: Sequence[Mutant], origin: Path = ROOT, workers: int = 2) -> list[Mutant]:
    """Print each mutant's verdict as it comes; returns the mutants that were not caught."""
    others = []
    for mutant, verdict, said, seconds in plant_all(mutants, origin, workers):
        print(f"{verdict:9s} {seconds:5.0f} s  {mutant}", flush=True)
        if verdict != "caught":
            others.append(mutant)
        if verdict == "invalid":
            print(said, flush=True)
    print(f"{len(mutants) - len(others)} of {len(mutants)} caught")
    return others


if __name__ == "__main__":
    from tests.mutants.bugs import MUTANTS

    words = sys.argv[1:] or [""]
    report([mutant for mutant in MUTANTS if any(word in f"{mutant} {mutant.tests}" for word in words)])
