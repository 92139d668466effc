"""Web application: every stage in the viewer in a browser, with controls for every parameter or without.

Nothing heavy is loaded before `serve` is called: the other commands must not wait for it.
"""

from __future__ import annotations

from typing import Any


def serve(*arguments: Any, **named: Any) -> None:
    """Serve the page of a recording until Ctrl-C; see `server.serve`."""
    from .server import serve as served

    served(*arguments, **named)
