"""The tuner: sliders for every parameter beside the viewer, in a page served on this machine.

Nothing heavy is loaded before `serve` is called: the other commands must not wait for it.
"""

from __future__ import annotations

from pathlib import Path

from spinscope.pipeline.session import Choices


def serve(path: Path, choices: Choices, port: int | None, open_browser: bool) -> None:
    """Open a recording and serve its page on 127.0.0.1 until Ctrl-C, printing the address once it answers.

    port : asked for; another free one is taken when it is busy. None for the usual one
    open_browser : whether to open the page where there is a graphical browser
    Raises SpinscopeError for a recording or choices that are no good.
    """
    from .serving import serve as served

    served(path, choices, port, open_browser)
