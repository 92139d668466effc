"""Presets: named parameters of the program, and TOML files of [group] tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import ParameterError
from ..files import file_bytes
from ..registry import Parameters
from ..toml import MAX_BYTES, toml_tables

FOLDER = Path(__file__).parent


def preset_names() -> tuple[str, ...]:
    """Names of the presets that ship with the program."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.toml")))


def preset(
    name: str | Path, on_rename: Callable[[str], None] | None = None, base: Parameters | None = None
) -> Parameters:
    """Parameters of a preset.

    Parameters
    ----------
    name : str or Path
        `default`, `paper`, or the path of a TOML file of [group] tables.
    on_rename : callable, optional
        Told of parameters under a former name, one sentence each.
    base : Parameters, optional
        What holds for values that the preset does not state; the defaults if not given.

    Raises
    ------
    ParameterError
        When there is no such preset, or the file holds something that is not allowed.
    """
    path = Path(name) if str(name).endswith(".toml") else FOLDER / f"{name}.toml"
    try:
        values = toml_tables(file_bytes(path, MAX_BYTES).decode("utf-8"))
    except FileNotFoundError:
        known = ", ".join(preset_names())
        raise ParameterError(f"there is no preset {str(name)!r}: use {known} or the path of a .toml file") from None
    except (OSError, ValueError, ParameterError) as error:
        why = getattr(error, "strerror", None) or error
        raise ParameterError(f"the preset cannot be read ({why}): {path}") from None
    return (base or Parameters()).with_values(values, on_rename)
