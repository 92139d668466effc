"""Spinscope: the spin of a table tennis ball from an event camera.

The one import package of the distribution. A wheel holds `app/` and `pipeline/` inside it; in a checkout they stand at
the top level, and the links beside this file show linters and type checkers the same tree.
"""

from pathlib import Path

_here = Path(__file__).parent
if _here.parent.name == ".package":
    __path__.insert(0, str(_here.parents[1]))  # the folders themselves: links need rights that Windows may withhold

from spinscope.pipeline import *  # noqa: E402, F403
from spinscope.pipeline import __all__ as __all__  # noqa: E402
