"""Opening of recordings: lists of folders, summaries, dropped files."""

from __future__ import annotations

import asyncio
import re
import shutil
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from spinscope.app.web.app_state import AppState
from spinscope.app.web.recording_folder import RecordingFolders
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.session import Choices
from spinscope.pipeline.simulated_recordings import simulate_to_file

from .browser_tab import Tab, bare_tab, needs_browser
from .conftest import Served, served

BYTES = {"content-type": "application/octet-stream"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording, a damaged one, and one in a subfolder."""
    root = tmp_path_factory.mktemp("recordings")
    simulate_to_file("spinner", root / "spinner.h5", duration_ms=25.0, width_px=320, height_px=240)
    (root / "damaged.h5").write_bytes(b"no HDF5 at all")
    (root / "notes.txt").write_text("no recording", encoding="utf-8")
    (root / "more").mkdir()
    shutil.copy(root / "spinner.h5", root / "more/other.h5")
    return root


@pytest.fixture(scope="module")
def own(folder: Path) -> Iterator[Served]:
    """A server of that folder."""
    made = served(folder / "spinner.h5")
    yield made
    made.stop()


def test_a_folder_lists_its_recordings_and_folders(own: Served, folder: Path) -> None:
    found = httpx.get(f"{own.address}api/folder").json()
    assert [one["name"] for one in found["recordings"]] == ["damaged.h5", "spinner.h5"]
    assert found["folders"] == ["more"] and found["root"] == str(folder)
    below = httpx.get(f"{own.address}api/folder", params={"folder": "more"}).json()
    assert [one["name"] for one in below["recordings"]] == ["more/other.h5"]
    assert own.open("more/other.h5").opening["recording"]["name"] == "more/other.h5"


def test_several_folders_are_listed_by_their_names(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    shutil.copy(folder / "spinner.h5", tmp_path / "more/third.h5")
    folders = RecordingFolders([folder, folder / "more", tmp_path / "more"])
    names = [folder.name, "more", "more-2"]
    assert folders.listing().folders == names and folders.listing().recordings == []
    assert [one.name for one in folders.listing("more-2").recordings] == ["more-2/third.h5"]
    assert folders.path("more-2/third.h5") == tmp_path / "more/third.h5"
    assert folders.name_of(tmp_path / "more/third.h5") == "more-2/third.h5"
    for name in ("third.h5", "none/third.h5", "more/../spinner.h5", str(tmp_path / "more/third.h5")):
        with pytest.raises(RecordingError):
            folders.path(name)
    with pytest.raises(RecordingError):
        folders.listing("..")


def test_a_folder_above_is_listed_by_its_own_name(folder: Path, tmp_path: Path) -> None:
    above = folder / "more/.."
    state = AppState(above / "spinner.h5", Choices(), folders=[above, tmp_path])
    assert state.folders.listing().folders == [folder.name, tmp_path.name]
    assert state.folders.name_of(state.path) == f"{folder.name}/spinner.h5"
    state.close()


@pytest.mark.parametrize("name", ["..", "../x", "more/../..", "/", "/etc", "a\\b", "none", "\0"])
def test_nothing_outside_of_the_folder_is_listed_or_opened(own: Served, name: str) -> None:
    assert httpx.get(f"{own.address}api/folder", params={"folder": name}).status_code == 400
    assert httpx.post(f"{own.address}api/sessions", json={"recording": name}).status_code == 400
    assert httpx.get(f"{own.address}api/summary", params={"name": name}).status_code == 400


def test_a_summary_tells_of_events_and_shots_or_what_is_wrong(own: Served) -> None:
    good = httpx.get(f"{own.address}api/summary", params={"name": "spinner.h5"}, timeout=240).json()
    assert good["events"] > 0 and good["duration_us"] > 0 and good["error"] is None
    assert good["picture"].startswith("data:image/png;base64,") and good["shots"] is not None and good["spin"]
    bad = httpx.get(f"{own.address}api/summary", params={"name": "damaged.h5"}, timeout=240).json()
    assert "damaged.h5" in bad["error"] and bad["events"] is None


def test_a_dropped_file_is_opened_and_goes_with_the_program(folder: Path) -> None:
    own = served(folder / "spinner.h5")
    try:
        content = (folder / "spinner.h5").read_bytes()
        for expected in ("dropped:mine.h5", "dropped:mine-2.h5"):
            answer = httpx.post(
                f"{own.address}api/drop", params={"name": "a/../mine.h5"}, content=content, headers=BYTES
            )
            assert answer.json() == {"name": expected}
        assert own.open("dropped:mine.h5").opening["recording"]["events"] > 0
        listed = [one["name"] for one in httpx.get(f"{own.address}api/folder").json()["recordings"]]
        assert listed[:2] == ["dropped:mine-2.h5", "dropped:mine.h5"]
        kept = own.state.folders.path("dropped:mine.h5")
        for name in (f"dropped:{folder / 'spinner.h5'}", "dropped:../spinner.h5", "dropped:"):
            with pytest.raises(RecordingError):
                own.state.folders.path(name)
        assert kept.read_bytes() == content
    finally:
        own.stop()
    assert not kept.exists() and not kept.parent.exists()


async def chunks(count: int, *, breaks: bool = False) -> AsyncIterator[bytes]:
    """A file of so many pieces of 10 bytes, which may break off."""
    for _ in range(count):
        yield b"0123456789"
    if breaks:
        raise ConnectionError


def test_too_much_and_what_breaks_off_leaves_nothing(tmp_path: Path) -> None:
    folder = RecordingFolders([tmp_path], dropped_bytes=100)
    kept = asyncio.run(folder.drop("first.h5", chunks(6)))
    with pytest.raises(RecordingError, match="too large"):
        asyncio.run(folder.drop("second.h5", chunks(5)))
    with pytest.raises(ConnectionError):
        asyncio.run(folder.drop("third.h5", chunks(1, breaks=True)))
    assert list(kept.parent.iterdir()) == [kept]
    folder.close()
    assert not kept.parent.exists()


@pytest.mark.parametrize("kind", ["application/json", "multipart/form-data", "text/plain", ""])
def test_a_form_of_another_page_can_drop_nothing(own: Served, kind: str) -> None:
    answer = httpx.post(f"{own.address}api/drop", params={"name": "x.h5"}, content=b"1", headers={"content-type": kind})
    assert answer.status_code == 415


@pytest.fixture
def bare(browser: Any, own: Served) -> Iterator[Tab]:
    """The page without the viewer's picture."""
    made = bare_tab(browser, own.address)
    yield made
    made.page.context.close()


def opened(tab: Tab, name: str) -> None:
    """Wait until a recording is open and computed."""
    tab.until(f"window.spinscope?.connection?.recording === '{name}' && document.body.dataset.done !== undefined")


@needs_browser[0]
@needs_browser[1]
def test_the_list_opens_recordings_and_says_what_is_wrong_with_others(bare: Tab) -> None:
    page = bare.page
    page.keyboard.press("o")
    rows = page.locator("#recordings tbody tr")
    page.locator("#recordings td.error").wait_for()
    assert "damaged.h5" in page.inner_text("#recordings td.error")
    page.locator("#recordings img").first.wait_for()
    assert page.locator("#recordings [aria-current]").inner_text() == "spinner.h5"
    page.get_by_role("button", name="more").click()
    # The playhead moves while the server opens the recording.
    page.evaluate("""() => {
        const ask = window.fetch, { viewer } = window.spinscope;
        window.fetch = async (...request) => {
            if (!String(request[0]).includes("openable")) return ask(...request);
            viewer.dispatchEvent(new CustomEvent("moved", { detail: 5000 }));
            await new Promise((resolve) => setTimeout(resolve, 500));
            return ask(...request);
        };
    }""")
    page.get_by_role("button", name="other.h5").click()
    opened(bare, "more/other.h5")
    page.keyboard.press("o")
    page.locator("#recordings .chip").first.wait_for()  # opened lately
    assert rows.count() == 1
    page.locator("#recordings .chip").first.click()
    opened(bare, "spinner.h5")


@needs_browser[0]
@needs_browser[1]
def test_a_file_is_dropped_onto_the_page(bare: Tab, folder: Path) -> None:
    page = bare.page
    drop = """async ([name, address, size]) => {
        const content = address ? await (await fetch(address)).blob() : new Blob([new Uint8Array(size)]);
        const files = new DataTransfer();
        files.items.add(new File([content], name));
        document.dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
    }"""
    page.evaluate("window.isSamePage = true")
    page.evaluate(drop, ["nonsense.h5", "", 10])
    page.locator(".notice.error", has_text="nonsense.h5").wait_for()
    page.wait_for_url(re.compile("recording=spinner"))
    assert page.evaluate("window.isSamePage")  # as it was
    # One of the folder is opened there, by its name and size; nothing is copied.
    page.evaluate(drop, ["damaged.h5", "", (folder / "damaged.h5").stat().st_size])
    page.locator(".notice.error", has_text="damaged.h5").wait_for()
    names = [one["name"] for one in httpx.get(f"{bare.page.url.partition('#')[0]}api/folder").json()["recordings"]]
    assert "dropped:nonsense.h5" in names and "dropped:damaged.h5" not in names
