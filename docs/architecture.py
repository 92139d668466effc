"""Draw the packages and their imports from the code: `uv run python docs/architecture.py` writes architecture.svg.

A package is a box of its own. The single modules of a folder (`app`, `pipeline`) share one box if they import packages
of that folder, directly or not, and another if they import none. Rows follow from the imports: a box stands above all
that it imports. Imports that others imply are not drawn.
"""

from __future__ import annotations

import hashlib
import itertools
import textwrap
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
from matplotlib import rc_context
from matplotlib.figure import Figure

PICTURE = Path(__file__).with_suffix(".svg")
ROOT = "spinscope"
COLOURS = {"app": "#fde3c8", "pipeline": "#d3e4f7"}
NAMES = {
    "app+": "command line",
    "app-": "shared by the user interfaces",
    "pipeline+": "API and chain",
    "pipeline-": "value types",
}
WIDTH, GAP, HEADING, LINE, ROW_GAP = 3.3, 0.3, 0.36, 0.13, 0.36  # inches


@dataclass(frozen=True)
class Box:
    """A package, or the single modules of a folder.

    Attributes
    ----------
    folder : str
        `app` or `pipeline`.
    name : str
        Heading.
    modules : tuple of str
        Modules inside, without the prefix they share.
    """

    folder: str
    name: str
    modules: tuple[str, ...]


def boxes_and_arrows() -> tuple[dict[str, Box], set[tuple[str, str]]]:
    """Boxes by key, and (importer, imported) pairs of keys, without those that others imply.

    Raises CycleError, with their names, where packages import each other.
    """
    graph = grimp.build_graph(ROOT, cache_dir=None)  # a cache goes by times of change: wrong after a checkout
    home: dict[str, str] = {}  # module of the second level -> key of its box
    for folder in ("app", "pipeline"):
        children = graph.find_children(f"{ROOT}.{folder}")
        packages = {child for child in children if graph.find_children(child)}
        for child in children:
            if child in packages:
                home[child] = child
            else:
                below = graph.find_upstream_modules(child)
                home[child] = f"{folder}+" if any(_in(module, packages) for module in below) else f"{folder}-"
    boxes = {}
    for key in sorted(set(home.values())):
        inside = sorted(graph.find_children(key)) if key in home else [m for m in sorted(home) if home[m] == key]
        folder = key.split(".")[1] if key in home else key[:-1]
        name = f"{folder}/{key.split('.')[-1]}/" if key in home else NAMES[key]
        boxes[key] = Box(folder, name, tuple(module.split(".")[-1] for module in inside))
    arrows = set()
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            ends = [home.get(".".join(module.split(".")[:3])) for module in (importer, imported)]
            if ends[0] and ends[1] and ends[0] != ends[1]:
                arrows.add((ends[0], ends[1]))
    TopologicalSorter({key: {end for begin, end in arrows if begin == key} for key in boxes}).prepare()
    return boxes, _reduced(arrows)


def digest() -> str:
    """Hash of what the picture shows; the picture holds it as its description."""
    boxes, arrows = boxes_and_arrows()
    return hashlib.sha256(repr((sorted(boxes.items(), key=str), sorted(arrows))).encode()).hexdigest()


def draw() -> Figure:
    """The picture: boxes in rows, arrows from the importer to the imported, led around the boxes between them."""
    boxes, arrows = boxes_and_arrows()
    rows, paths = _rows(boxes, arrows)
    texts = {key: textwrap.wrap(", ".join(box.modules), 58) for key, box in boxes.items()}
    heights = {key: HEADING + LINE * len(text) for key, text in texts.items()}
    row_heights = [max(heights.get(key, 0.0) for key in row) for row in rows]
    width = max(sum(_width(key, boxes) + GAP for key in row) for row in rows) + GAP
    height = sum(row_heights) + ROW_GAP * len(rows)
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.axis("off")
    places: dict[str, tuple[float, float, float]] = {}  # middle, top, bottom
    top = ROW_GAP / 2
    for row, row_height in zip(rows, row_heights, strict=True):
        left = (width - sum(_width(key, boxes) for key in row) - GAP * (len(row) - 1)) / 2
        for key in row:
            places[key] = (left + _width(key, boxes) / 2, top, top + row_height)
            left += _width(key, boxes) + GAP
        top += row_height + ROW_GAP
    for path in paths:
        points: list[tuple[float, float]] = []
        for key, towards in zip(path, [*path[1:], path[-2]], strict=True):
            middle, upper, lower = places[key]
            if key not in boxes:
                points += [(middle, upper), (middle, lower)]
                continue
            reach = 0.3 * WIDTH
            x = middle + max(-reach, min(reach, (places[towards][0] - middle) / 3))
            points.append((x, lower if key == path[0] else upper))
        axes.plot(*zip(*points, strict=True), color="#555555", linewidth=0.9, zorder=1)
        head = {"arrowstyle": "-|>", "color": "#555555", "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", points[-1], points[-2], arrowprops=head, zorder=1)
    for key, box in boxes.items():
        middle, upper, lower = places[key]
        left, right = middle - WIDTH / 2, middle + WIDTH / 2
        patch = {"facecolor": COLOURS[box.folder], "edgecolor": "#333333", "linewidth": 0.8}
        axes.fill([left, right, right, left], [upper, upper, lower, lower], zorder=2, **patch)
        axes.text(middle, upper + 0.15, box.name, ha="center", va="center", fontsize=9, fontweight="bold", zorder=3)
        axes.text(middle, upper + 0.28, "\n".join(texts[key]), ha="center", va="top", fontsize=7, zorder=3)
    return figure


def _width(key: str, boxes: dict[str, Box]) -> float:
    return WIDTH if key in boxes else 0.0


def _in(module: str, packages: set[str]) -> bool:
    return ".".join(module.split(".")[:3]) in packages


def _reduced(arrows: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The transitive reduction of an acyclic graph."""

    def reaches(start: str, goal: str) -> bool:
        return any(end == goal or reaches(end, goal) for begin, end in arrows if begin == start)

    implied = {(a, c) for a, c in arrows if any(reaches(b, c) for start, b in arrows if start == a and b != c)}
    return arrows - implied


def _rows(boxes: dict[str, Box], arrows: set[tuple[str, str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Keys by row from the top, and each arrow's path; names that are no boxes' keep a gap for an arrow in a row.

    Boxes stand as low as their imports allow, and in their row near what they are imported by.
    """
    depth: dict[str, int] = {}

    def depth_of(key: str) -> int:
        if key not in depth:
            depth[key] = 1 + max((depth_of(end) for begin, end in arrows if begin == key), default=-1)
        return depth[key]

    rows: list[list[str]] = [[] for _ in range(1 + max(map(depth_of, boxes)))]
    for key in sorted(boxes):
        rows[depth[key]].append(key)
    paths = []
    for begin, end in sorted(arrows):
        between = [(level, f"{begin} > {end} at {level}") for level in range(depth[begin] - 1, depth[end], -1)]
        for level, gap in between:
            rows[level].append(gap)
        paths.append([begin, *(gap for _, gap in between), end])
    rows.reverse()
    importers: dict[str, list[str]] = {}
    for path in paths:
        for above, below in itertools.pairwise(path):
            importers.setdefault(below, []).append(above)
    across: dict[str, float] = {}
    for row in rows:
        row.sort(key=lambda key: _mean([across[above] for above in importers.get(key, [])]))
        across |= {key: (place + 0.5) / len(row) for place, key in enumerate(row)}
    return rows, paths


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else 0.5


if __name__ == "__main__":
    with rc_context({"svg.hashsalt": ROOT, "svg.fonttype": "none", "font.family": "sans-serif"}):
        draw().savefig(PICTURE, metadata={"Description": digest(), "Date": None})
