"""Everything that is open: the recordings of one folder, and the pages that look at them."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from pathlib import Path
from tempfile import TemporaryDirectory

from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.recordings import readable_suffixes
from spinscope.pipeline.session import Choices

from .bench import Bench
from .finder import ShotFinder
from .page import Page

BENCHES_KEPT = 2  # each holds its events: 20 s of a rally are 260 MB
PAGES_MOST = 16
ALONE_S = 20.0  # a page without its browser for so long is closed; a reload takes less


class Workshop:
    """The recordings opened so far and the pages on them.

    path : the recording that was asked for; others of its folder may be opened from the page
    """

    def __init__(self, path: Path, choices: Choices) -> None:
        self.path = path.absolute()
        self.folder = self.path.parent
        self.drawings = DrawingCache()
        self._choices = choices
        self._benches: OrderedDict[Path, Bench] = OrderedDict()
        self._finders: dict[Path, ShotFinder] = {}
        self._scratch: TemporaryDirectory[str] | None = None
        self._pages: dict[str, Page] = {}
        self._lock = threading.Lock()

    def bench(self, name: str | None = None) -> Bench:
        """The recording of that name in the folder, opened when it is not yet; raises SpinscopeError."""
        path = self.path if name is None else self._inside(name)
        with self._lock:
            bench = self._benches.pop(path, None)
            if bench is None:
                bench = Bench.open(path, self._choices if path == self.path else self._choices.for_others)
            self._benches[path] = bench
            while len(self._benches) > BENCHES_KEPT:
                self._drop(self._benches.popitem(last=False)[0])
            return bench

    def _drop(self, path: Path) -> None:
        finder = self._finders.pop(path, None)
        if finder is not None:
            finder.close()

    def recordings(self) -> list[str]:
        """Names of the recordings in the folder."""
        found = {
            path.name for path in self.folder.iterdir() if path.suffix.lower() in readable_suffixes() and path.is_file()
        }
        return sorted(found | {self.path.name})

    def open_page(self, name: str | None) -> Page:
        """A new page on a recording; raises SpinscopeError."""
        bench = self.bench(name)
        self.close_lonely_pages()
        with self._lock:
            if len(self._pages) >= PAGES_MOST:
                raise ParameterError(f"{PAGES_MOST} pages are open: close one of them")
            page = Page(bench, self.drawings)
            self._pages[page.id] = page
        self.look_for_shots(page)
        return page

    def look_for_shots(self, page: Page) -> None:
        """Tell the page of the shots of a long recording, looking for them when nobody has yet."""
        bench = page.bench
        if bench.is_long:
            path = bench.session.recording.path
            finder = self._finders.setdefault(path, ShotFinder(bench))
            finder.add(page.outbox, bench.session.parameters)

    @property
    def scratch(self) -> Path:
        """A folder for simulated recordings; it goes with the program."""
        if self._scratch is None:
            self._scratch = TemporaryDirectory(prefix="spinscope-")
        return Path(self._scratch.name)

    def page(self, page_id: str) -> Page | None:
        """The page of that id, if it is open."""
        return self._pages.get(page_id)

    def close_lonely_pages(self) -> None:
        """Close the pages that no browser has listened to for a while."""
        now = time.monotonic()
        for page in list(self._pages.values()):
            if page.listeners == 0 and now - page.last_sign_of_life > ALONE_S:
                self.close_page(page)

    def close_page(self, page: Page) -> None:
        """End a page: its run, its work and its connection."""
        self._pages.pop(page.id, None)
        page.close()
        for finder in list(self._finders.values()):
            finder.remove(page.outbox)

    def close(self) -> None:
        """Close all pages, wait for all threads, and leave nothing behind."""
        pages = list(self._pages.values())
        for page in pages:
            page.close()
        for finder in self._finders.values():
            finder.close()
        for page in pages:
            page.join(2.0)
        self.drawings.close()
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def _inside(self, name: str) -> Path:
        path = self.folder / name
        if not name or Path(name).name != name or not path.is_file():
            raise RecordingError(f"there is no recording {name!r} in the opened folder: choose one of its files")
        return path
