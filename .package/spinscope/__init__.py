"""Spinscope: the spin of a table tennis ball from an event camera.

The one import package of the distribution. A wheel holds `app/` and `pipeline/` inside it; in a checkout they stand at
the top level, and the links beside this file show linters and type checkers the same tree.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

_here = Path(__file__).parent
if _here.parent.name == ".package":
    __path__.insert(0, str(_here.parents[1]))  # the folders themselves: links need rights that Windows may withhold

from spinscope import pipeline  # noqa: E402

if TYPE_CHECKING:
    from spinscope.pipeline import *  # noqa: F403

__all__ = pipeline.__all__


def __getattr__(name: str) -> Any:
    return getattr(pipeline, name)


def __dir__() -> list[str]:
    return list(pipeline.__all__)
