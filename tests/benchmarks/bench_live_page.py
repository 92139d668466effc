"""A running camera of 1 Mev/s with its page open in a browser: pictures a second, and what the page costs the tracker.

`pytest tests/benchmarks/bench_live_page.py --benchmark-only -s`; nothing else should run on the machine.
"""

from __future__ import annotations

import json
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from spinscope.pipeline.evaluation.suites.live import busy_round
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.session import DEFAULT_SAMPLE, Session
from tests.app.web.browser_tab import CHROMIUM, FLAGS, PATIENCE_MS

RATE_MEV_S = 1.0
SECONDS = 20  # of which each p99 is taken, second by second
LEAST_PICTURES_HZ, MOST_ADDED_MS = 5.0, 2.0


@contextmanager
def live(recording: Path, lines: Path) -> Iterator[str]:
    """Address of the page of a looped recording; lines of JSON go to a file."""
    options = ["--replay", str(recording), "--loop", "--jsonl", str(lines), "--no-browser", "--port", "0"]
    command = [sys.executable, "-m", "spinscope", "live", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        try:
            yield next(found[0] for said in process.stdout if (found := re.search(r"http://127\.0\.0\.1:\S+", said)))
        finally:
            process.kill()


def p99s_ms(lines: Path, wait: Callable[[], object]) -> list[float]:
    """The p99 of each of the next seconds."""
    begun = len(lines.read_text().splitlines())
    while True:
        written = [json.loads(line) for line in lines.read_text().splitlines()[begun:-1]]
        told = [one["status"]["p99_ms"] for one in written if "status" in one and one["status"]["p99_ms"] is not None]
        if len(told) >= SECONDS:
            return told[:SECONDS]
        wait()


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"there is no browser at {CHROMIUM}")
def test_page_of_a_running_camera(benchmark: Any, tmp_path: Path) -> None:
    """Without the page, with it, and without it once more."""
    from playwright.sync_api import sync_playwright

    sample = Session.open(DEFAULT_SAMPLE)
    recording, lines = tmp_path / "busy.raw", tmp_path / "lines.jsonl"
    events, source = busy_round(sample, RATE_MEV_S), sample.source
    write_recording(recording, events, width_px=source.width_px, height_px=source.height_px)
    with live(recording, lines) as address, sync_playwright() as playwright:
        alone_ms = p99s_ms(lines, lambda: time.sleep(1.0))
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(PATIENCE_MS)
        pictures = list[str]()
        page.on("requestfinished", lambda one: pictures.append(one.url) if "live/picture" in one.url else None)
        page.goto(address)
        page.wait_for_selector("body[data-shown]", state="attached")

        def watched() -> tuple[float, list[float]]:
            before, begun_s = len(pictures), time.monotonic()
            open_ms = p99s_ms(lines, lambda: page.wait_for_timeout(100))  # the browser's events come meanwhile
            return (len(pictures) - before) / (time.monotonic() - begun_s), open_ms

        pictures_hz, open_ms = benchmark.pedantic(watched, rounds=1)
        browser.close()
        alone_ms += p99s_ms(lines, lambda: time.sleep(1.0))
    alone, opened = statistics.median(alone_ms), statistics.median(open_ms)
    print(
        f"\n{pictures_hz:.1f} pictures a second (asked for: {LEAST_PICTURES_HZ:g}); p99 of the track, medians of the "
        f"seconds: {alone:.1f} ms, with the page {opened:.1f} ms (asked for: {MOST_ADDED_MS:g} ms more at most)"
    )
