"""TOML files of the user, like presets."""

from __future__ import annotations

import tomllib
from typing import Any

from .errors import ParameterError

MAX_BYTES = 1 << 20  # all parameters take 6 kB
# Python's parser takes minutes for a key of some ten thousand parts. Ours have two, and dots stand in numbers, too.
MAX_LINE_DOTS = 40


def toml_tables(text: str) -> dict[str, Any]:
    """Tables of a TOML text; raises ParameterError, without a path, for what is none or was made to do harm."""
    if len(text) > MAX_BYTES:
        raise ParameterError(f"it has {len(text)} characters: at most {MAX_BYTES} are read")
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > MAX_LINE_DOTS:
            raise ParameterError(f"line {number} has {line.count('.')} dots: at most {MAX_LINE_DOTS} are read")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ParameterError("its values are nested too deep") from None
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"it is no TOML: {str(error)[:200]}") from None
    except ValueError:
        raise ParameterError("it holds an integer of thousands of digits") from None
