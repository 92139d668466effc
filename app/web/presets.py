"""Presets: the built-in ones, TOML of the user, and the command line that gives the same numbers."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tomli_w

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.presets import FOLDER
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.toml import toml_tables

from .controls import setup_of

Values = dict[str, dict[str, Any]]
BIAS_FILE, AGAIN_FILE = "spinscope.bias", "again.h5"  # what the page saves, and the scene simulated with it


def built_in(opened: Parameters) -> dict[str, Values]:
    """Presets by name, each in the set-up of the opened recording; `opened` is what it was opened with."""
    found = {}
    for path in sorted(FOLDER.glob("*.toml")):
        found[path.stem] = applied(path.read_text(encoding="utf-8"), opened).as_dict()
    found["opened"] = opened.as_dict()
    return found


def applied(text: str, opened: Parameters, on_rename: Callable[[str], None] | None = None) -> Parameters:
    """Parameters of a TOML preset; what belongs to the set-up is kept unless the preset names it.

    `on_rename` is told of every parameter under a former name.

    Raises ParameterError that says what is wrong with the preset.
    """
    try:
        values = toml_tables(text)
    except ParameterError as error:
        raise ParameterError(f"the preset cannot be read: {error}") from None
    return Parameters().with_values(setup_of(opened)).with_values(values, on_rename)


def as_toml(parameters: Parameters) -> str:
    """TOML of all that differs from the defaults."""
    note = "# Settings of Spinscope; what is not named here has its default.\n\n"
    return note + tomli_w.dumps(_differing(parameters, Parameters()))


def command(path: Path, parameters: Parameters, window_us: tuple[int, int] | None, *, again: bool = False) -> str:
    """Command that gives the same numbers, `spinscope analyze ...`, ready for a shell.

    Parameters
    ----------
    path : Path
        The recording.
    window_us : (int, int) or None
        Clip [start, end); None for all of it.
    again : bool
        Whether the scene of the recording was simulated again, with the biases of BIAS_FILE.
    """
    words = ["spinscope", "analyze", AGAIN_FILE if again else str(path)]
    for group, values in _differing(parameters, Parameters()).items():
        for name, value in values.items():
            words += ["--set", f"{group}.{name}={_assignment(value)}"]
    if window_us is not None:
        words += ["--window", str(window_us[0]), str(window_us[1])]
    line = shlex.join(words)
    if not again:
        return line
    first = ["spinscope", "simulate", "again", "--scene", str(path), "--biases", BIAS_FILE, "--out", AGAIN_FILE]
    return f"{shlex.join(first)} && {line}"


def differences(parameters: Parameters, other: Parameters) -> list[tuple[str, Any, Any]]:
    """(stage.field, value, other's value) of all that differs."""
    found = []
    theirs = other.as_dict()
    for group, values in parameters.as_dict().items():
        found += [(f"{group}.{k}", v, theirs[group][k]) for k, v in values.items() if v != theirs[group][k]]
    return found


def _differing(parameters: Parameters, other: Parameters) -> Values:
    theirs, found = other.as_dict(), {}
    for group, values in parameters.as_dict().items():
        changed = {name: value for name, value in values.items() if value != theirs[group][name]}
        if changed:
            found[group] = changed
    return found


def _assignment(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(repr(item) for item in value)
    return "none" if value is None else str(value)
