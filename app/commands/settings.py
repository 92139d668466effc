"""`spinscope settings`: every setting with its default, range and meaning."""

from __future__ import annotations

import json
from typing import Any

import click
from rich.table import Table

from spinscope.pipeline.registry import STAGES, Parameters

from ..terminal import console
from .options import RegisteredName, write_text


def _stage_names() -> tuple[str, ...]:
    """Names by which settings can be asked for: groups of parameters, and stages that read a group of another name."""
    return tuple(dict.fromkeys([*Parameters.group_types(), *STAGES.names]))


@click.command()
@click.option("--stage", type=RegisteredName(_stage_names), help="Only the settings of this stage or group.")
@click.option("--json", "output", type=click.Path(), help="Write JSON to this file, - for standard output.")
def settings(stage: str | None, output: str | None) -> None:
    """List all settings (`--set STAGE.FIELD=VALUE`) with unit, range, default and meaning.

    They are the same as the sliders of the page and the fields of presets.
    """
    rows = setting_rows(stage)
    if output:
        write_text(output, json.dumps(rows) + "\n")
    else:
        print_settings(rows)


def setting_rows(stage: str | None = None) -> list[dict[str, Any]]:
    """Declarations of the settings of a stage or group, of all for None, ready for JSON."""
    groups = Parameters.group_types()
    if stage is not None:
        name = stage if stage in groups else STAGES[stage].group
        groups = {name: groups[name]}
    return [
        {
            "name": f"{group}.{field}",
            "unit": declared.unit,
            "default": declared.default,
            "low": declared.low,
            "high": declared.high,
            "choices": list(declared.choices),
            "allowed": declared.allowed,
            "help": declared.help,
        }
        for group, parameters in groups.items()
        for field, declared in parameters.tunables().items()
    ]


def print_settings(rows: list[dict[str, Any]]) -> None:
    """Print the settings as a table, an empty line between two groups."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column("setting", no_wrap=True)
    table.add_column("default")
    table.add_column("range")
    table.add_column("meaning")
    group = rows[0]["name"].partition(".")[0]
    for row in rows:
        if (own := row["name"].partition(".")[0]) != group:
            table.add_row()
            group = own
        table.add_row(row["name"], _default(row["default"], row["unit"]), row["allowed"], row["help"])
    console().print(table, markup=False, highlight=False)


def _default(value: Any, unit: str) -> str:
    """Default as `--set` takes it, with its unit; a parameter that is found by the program itself is "auto"."""
    if value is None:
        return "auto"
    if isinstance(value, bool):
        return str(value).lower()
    numbers = value if isinstance(value, tuple) else (value,)
    text = ",".join(f"{number:g}" if isinstance(number, float) else str(number) for number in numbers)
    return f"{text} {unit}".strip()
