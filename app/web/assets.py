"""Scripts that the page takes from installed wheels, without importing these: Rerun's viewer and plotly.js."""

from __future__ import annotations

import importlib.util
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from spinscope.pipeline.errors import SpinscopeError

STATIC = Path(__file__).parent / "static"
CLASS = "\nvar WebViewer = class {"
# The viewer asks the window for its frames; through this object the page decides when it has them.
FRAMES = ("requestAnimationFrame", "cancelAnimationFrame")
EXPORT = """
var viewerFrames = window;
function setFrames(frames) { viewerFrames = frames; }
export { WebViewer, setFrames };
"""


def viewer_version() -> str:
    """Version of the viewer; raises SpinscopeError when script and SDK are of different versions."""
    try:
        sdk, script = version("rerun-sdk"), version("rerun-notebook")
    except PackageNotFoundError as error:
        raise SpinscopeError(f"{error.name} is not installed: run `uv sync`") from None
    if sdk != script:
        raise SpinscopeError(f"rerun-sdk is {sdk}, rerun-notebook {script}: both must be the same, run `uv sync`")
    return sdk


def viewer_wasm() -> Path:
    """Path of the viewer's WebAssembly."""
    return _folder("rerun_notebook") / "static" / "re_viewer_bg.wasm"


def viewer_script() -> str:
    """Script of the viewer with its class exported, and with frames that can be held by `setFrames`.

    Raises SpinscopeError when the class or what asks for frames is not in it.
    """
    try:
        script = (_folder("rerun_notebook") / "static" / "widget.js").read_text(encoding="utf-8")
    except OSError as error:
        raise SpinscopeError(f"the viewer's script cannot be read ({error.strerror}): run `uv sync`") from None
    if CLASS not in script or any(script.count(f"arg0.{name}(arg1)") != 1 for name in FRAMES):
        raise SpinscopeError("the viewer's script is another one: rerun-notebook must be 0.41.0, run `uv sync`")
    for name in FRAMES:
        script = script.replace(f"arg0.{name}(arg1)", f"viewerFrames.{name}(arg1)")
    return script + EXPORT


def chart_script() -> Path:
    """Path of plotly.js."""
    return _folder("plotly") / "package_data" / "plotly.min.js"


def _folder(package: str) -> Path:
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise SpinscopeError(f"{package} is not installed: run `uv sync`")
    return Path(found.submodule_search_locations[0])
