"""Formats of recordings on disk: every module or package in this folder registers one in `registry`."""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
