"""The tuner: from a slider's change to the bytes at the server, to the picture in the browser, and 300 times over.

`pytest tests/benchmarks/bench_tuner.py --benchmark-only -s`; nothing else should run on the machine.
"""

from __future__ import annotations

import itertools
import re
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.app.web.conftest import Client, Served, served

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT / "sample_recordings/flight_fast_top.h5"
CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
CHANGES = 300
PLAYHEAD_US = 60_000.0  # two thirds into the flight
SHOWS = 20
PAUSE_MS = 1500  # the viewer paints on for a while after a recording came: each change finds it at rest

# What is changed by how much each time, and the medians that are asked for on the sample flight, 2 cores: of the
# preview while it is dragged, and of the whole picture, with contrast.
KNOBS: dict[str, tuple[str, str, float, float, float, float]] = {
    "pad": ("logo", "pad_px", 2.0, 0.01, 80, 140),
    "t_acc": ("flow", "t_acc_us", 1500, 10, 80, 140),
    "spin": ("spin", "max_spin_rps", 120, 0.5, 80, 140),
    "surface": ("surface", "k_px", 3, 1, 140, 180),
    "filter": ("filter", "threshold_us", 4000, 10, 140, 180),
}


@pytest.fixture(scope="module")
def tuner() -> Iterator[Served]:
    made = served(FLIGHT)
    yield made
    made.stop()


@pytest.fixture(scope="module")
def client(tuner: Served) -> Client:
    made = tuner.open()
    made.run()
    return made


def bytes_of(client: Client, parameters: dict[str, Any], contrast_ms: list[float]) -> bytes:
    """Change, wait, fetch: what the page does; notes what `contrast` took of it."""
    done = client.run(parameters, has_preview=False)  # the viewer has a picture
    contrast_ms.append(done["stages_ms"]["contrast"])
    return client.http.get(client.path(f"pictures/{done['picture']['id']}")).content


@pytest.mark.parametrize("knob", KNOBS)
def test_change_to_bytes(benchmark: Any, client: Client, knob: str) -> None:
    stage, field, start, step, _, target_ms = KNOBS[knob]
    counter, contrast_ms = itertools.count(), list[float]()
    kind = type(start) if knob != "spin" else float

    def change() -> tuple[tuple[Client, dict[str, Any], list[float]], dict[str, Any]]:
        values: dict[str, Any] = {field: kind(start + step * next(counter))}
        if knob == "t_acc":
            values["t_acc_from"] = "fixed"
        return (client, {stage: values}, contrast_ms), {}

    content = benchmark.pedantic(bytes_of, setup=change, rounds=15, warmup_rounds=1)
    median_ms = 1000 * benchmark.stats.stats.median
    late_ms = statistics.median(contrast_ms)
    print(
        f"\n{knob}: {median_ms:.0f} ms median for {len(content) / 1e6:.1f} MB, contrast {late_ms:.0f} ms of it "
        f"(asked for: {target_ms:.0f} ms)"
    )


@pytest.mark.parametrize("knob", KNOBS)
def test_change_to_preview(benchmark: Any, client: Client, knob: str) -> None:
    """While a slider is dragged: to the preview at the playhead; pictures are drawn when it rests."""
    stage, field, start, step, target_ms, _ = KNOBS[knob]
    counter = itertools.count(20)
    kind = type(start) if knob != "spin" else float

    def preview(values: dict[str, Any]) -> dict[str, Any]:
        request = client.request({stage: values}, interactive=True, playhead_us=PLAYHEAD_US)
        client.http.post(client.path("run"), json=request)
        return client.wait("preview", lambda m: m["serial"] == request["serial"])

    def change() -> tuple[tuple[dict[str, Any]], dict[str, Any]]:
        client.wait("run", lambda m: m["serial"] == client.serial and m["state"] == "done")
        client.messages.clear()
        values: dict[str, Any] = {field: kind(start + step * next(counter))}
        if knob == "t_acc":
            values["t_acc_from"] = "fixed"
        return (values,), {}

    client.run()
    told = benchmark.pedantic(preview, setup=change, rounds=15, warmup_rounds=1)
    median_ms = 1000 * benchmark.stats.stats.median
    print(
        f"\n{knob}: {median_ms:.0f} ms median for {len(told['picture']) / 1e3:.0f} kB (asked for: {target_ms:.0f} ms)"
    )


def test_back_to_earlier_values(benchmark: Any, client: Client) -> None:
    one, two = {"logo": {"pad_px": 2.0}}, {"logo": {"pad_px": 3.0}}
    for values in (one, two):
        bytes_of(client, values, [])
    turns = itertools.cycle((one, two))
    benchmark.pedantic(bytes_of, setup=lambda: ((client, next(turns), []), {}), rounds=20)
    print(f"\nback: {1000 * benchmark.stats.stats.median:.0f} ms median (asked for: 30 ms)")


def test_300_changes_and_the_picture_in_the_browser(benchmark: Any) -> None:
    """Server and browser over 300 changes: milliseconds, memory, threads."""
    if not CHROMIUM.exists():
        pytest.skip(f"there is no browser at {CHROMIUM}")
    benchmark.pedantic(_many_changes, rounds=1)


def _many_changes() -> None:
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "spinscope", "tune", str(FLIGHT), "--no-browser", "--port", "0"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
            page = browser.new_page(viewport={"width": 1000, "height": 620})
            page.set_default_timeout(180_000)
            page.goto(f"{address}#tab=Tracker")
            page.wait_for_selector("body[data-shown]", state="attached")
            _drive(page, process.pid)
            browser.close()
    finally:
        process.terminate()
        process.wait(20)
        process.stdout.close()


# Changes the pad, or moves its slider without letting go; milliseconds to the server's answer and to the first picture
# of it. The page looks itself: asking it again and again from outside would take the time that is measured.
CHANGE = """([pad, settled]) => new Promise((resolve) => {
    const { connection, runner, settings } = window.spinscope, { dataset } = document.body;
    const began = performance.now(), before = runner.serial;
    let answer = null;
    const heard = ({ detail }) => {
        if (detail.serial > before && detail.picture) answer ??= performance.now() - began;
    };
    connection.addEventListener("run", heard);
    const look = new MutationObserver(() => {
        if (runner.serial > before && dataset.picture.startsWith(`${connection.session}-${before + 1}`)) {
            look.disconnect();
            connection.removeEventListener("run", heard);
            resolve([answer, performance.now() - began]);
        }
    });
    look.observe(document.body, { attributes: true });
    settings.set("logo.pad_px", pad, settled);
})"""


def _drive(page: Any, pid: int) -> None:
    whole, dragged = [], []
    own_ms = statistics.median(_shows(page))
    print("\nchange  server RSS  threads  browser heap")
    for number in range(CHANGES):
        page.wait_for_timeout(PAUSE_MS)
        whole.append(page.evaluate(CHANGE, [round(2 + 0.01 * (number % 150), 2), True]))
        if number % 25 == 24:
            heap = page.evaluate("performance.memory?.usedJSHeapSize ?? 0") / 1e6
            print(
                f"{number + 1:6d}  {_status(pid, 'VmRSS') / 1e3:7.0f} MB  {_status(pid, 'Threads'):7d}  {heap:9.0f} MB"
            )
    for number in range(SHOWS):
        page.wait_for_timeout(2 * PAUSE_MS)  # the whole picture has come meanwhile
        dragged.append(page.evaluate(CHANGE, [round(4 + 0.01 * number, 2), False]))
    print(f"the viewer alone needs {own_ms:.0f} ms for a recording that is there already; medians from a change on:")
    for name, rows, also in (("a picture", whole, ", and 400 ms more for contrast"), ("while dragging", dragged, "")):
        answer_ms, picture_ms = (statistics.median(column) for column in zip(*rows, strict=True))
        print(
            f"{name}: answer {answer_ms:.0f} ms, to be seen after {picture_ms:.0f} ms: {picture_ms - own_ms:+.0f} ms "
            f"(asked for: 300 ms{also})"
        )


def _shows(page: Any) -> list[float]:
    """Milliseconds from two finished recordings' bytes, in turn, to their picture: nothing is computed meanwhile."""
    pictures = []
    for pad in (3.0, 4.0):
        page.evaluate(CHANGE, [pad, True])
        pictures.append(page.evaluate("`${window.spinscope.connection.session}-${window.spinscope.runner.serial}`"))
    took: list[float] = page.evaluate(
        """async ([pictures, count, pause]) => {
            const { connection, viewer } = window.spinscope, took = [], all = [];
            for (const id of pictures) {
                const answer = await fetch(connection.path(`pictures/${id}`));
                all.push([new Uint8Array(await answer.arrayBuffer()), id]);
            }
            for (let i = 0; i < count; i++) {
                await new Promise((resolve) => setTimeout(resolve, pause));
                const began = performance.now();
                await viewer.show(...all[i % 2], 0);
                took.push(performance.now() - began);
            }
            return took;
        }""",
        [pictures, SHOWS, PAUSE_MS],
    )
    return took


def _status(pid: int, name: str) -> int:
    """A number of /proc/PID/status (kB for memory)."""
    found = re.search(rf"^{name}:\s+(\d+)", Path(f"/proc/{pid}/status").read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return int(found.group(1))
