"""Sphinx configuration: `uv run sphinx-build -W docs docs/_build` writes docs/_build/index.html."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from importlib.metadata import version as version_of

from sphinx.application import Sphinx

import spinscope
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.stage import SpinMethod

project = "Spinscope"
author = "the Spinscope developers"
version = release = version_of("spinscope")

extensions = ["sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc", "myst_parser"]
exclude_patterns = ["_build", "examples"]
default_role = "code"
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the sections of the docstrings say dtype, shape and unit
autodoc_preserve_defaults = True
maximum_signature_line_length = 90
numpydoc_show_class_members = False  # autodoc lists them

html_theme = "furo"
html_title = f"Spinscope {release}"
html_copy_source = False


def public_names() -> Iterator[str]:
    """The public Python API as Markdown: functions, then errors, then the other classes."""
    names = [(name, getattr(spinscope, name)) for name in spinscope.__all__]
    functions = [name for name, value in names if inspect.isfunction(value)]
    errors = [name for name, value in names if inspect.isclass(value) and issubclass(value, Exception)]
    classes = [name for name, _ in names if name not in functions and name not in errors]
    for heading, group, directive, option in (
        ("Functions", functions, "autofunction", ""),
        ("Classes", classes, "autoclass", "   :members:\n   :inherited-members:\n"),
        ("Errors", errors, "autoexception", "   :show-inheritance:\n"),
    ):
        yield f"## {heading}\n\n```{{eval-rst}}"
        for name in group:
            yield f".. {directive}:: spinscope.{name}\n{option}"
        yield "```\n"


def parameter_groups() -> Iterator[str]:
    """All stages and parameters as Markdown, group by group, from the registry."""
    for group, parameters in Parameters.group_types().items():
        yield f"## `{group}`\n"
        stages = [stage for stage in STAGES if stage.group == group]
        if not stages:
            yield f"{(parameters.__doc__ or '').splitlines()[0]}\n"
        for stage in stages:
            kind = "spin method" if isinstance(stage, SpinMethod) else "stage"
            scope = "once per recording" if stage.scope == "recording" else "once per ball in flight"
            yield f"**{stage.label}** (`{stage.name}`, {kind}, runs {scope}). {stage.help}"
            reads = f"; reads {', '.join(f'`{name}`' for name in stage.reads)}" if stage.reads else ""
            yield f"Inputs: {', '.join(f'`{name}`' for name in stage.inputs)}{reads}.\n"
        yield "| name | default | range | unit | meaning |\n|---|---|---|---|---|"
        for name, declared in parameters.tunables().items():
            cells = (f"`{group}.{name}`", _value(declared.default), _range(declared), declared.unit, declared.help)
            yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
        yield ""


def _range(declared: Tunable) -> str:
    if declared.choices:
        return ", ".join(f"`{word}`" for word in declared.choices)
    if declared.kind == "switch":
        return "`true`, `false`"
    return f"{_value(declared.low)} to {_value(declared.high)}"


def _value(value: object) -> str:
    if isinstance(value, bool) or value is None:
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return ", ".join(map(_value, value))
    if isinstance(value, (int, float)):
        return f"{value:,.0f}" if value == int(value) else f"{value:g}"
    return f"`{value}`"


GENERATED = {"<!-- public names -->": public_names, "<!-- parameter groups -->": parameter_groups}


def insert_generated(_: Sphinx, __: str, source: list[str]) -> None:
    """Put the generated parts of a page in the place of their markers."""
    for marker, lines in GENERATED.items():
        if marker in source[0]:
            source[0] = source[0].replace(marker, "\n".join(lines()))


def setup(app: Sphinx) -> None:
    """Register the generated parts."""
    app.connect("source-read", insert_generated)
