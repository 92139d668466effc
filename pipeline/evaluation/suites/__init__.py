"""The suites: every module of this folder is one, of its own name, and is found and registered here."""

from importlib import import_module
from pkgutil import iter_modules

from ..suite import SUITES as SUITES
from ..suite import Suite

for _found in iter_modules(__path__):
    _module = import_module(f"{__name__}.{_found.name}")
    SUITES.register(
        Suite(
            name=_found.name,
            label=_module.LABEL,
            help=_module.HELP,
            tasks=_module.tasks,
            tables=_module.tables,
            figures=_module.figures,
            timed=getattr(_module, "TIMED", False),
            takes_scene_choices=getattr(_module, "TAKES_SCENE_CHOICES", False),
            takes_rivals=getattr(_module, "TAKES_RIVALS", False),
            real_kinds=getattr(_module, "REAL_KINDS", ()),
            real=getattr(_module, "real", None),
        )
    )
