"""The requests that the page may make, checked strictly: what is not named here is refused."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from pipeline.chain import Parameters
from pipeline.errors import ParameterError

Values = dict[str, dict[str, Any]]
TEXT_MOST = 100_000


class Request(BaseModel):
    """Unknown fields are refused, and nothing is taken for what it is not."""

    model_config = ConfigDict(extra="forbid", strict=True)


class OpenPage(Request):
    """A new page, on the recording the program was started with or another one of its folder."""

    recording: str | None = Field(default=None, max_length=255)


class Run(Request):
    """Show a clip with these parameters, beside those pinned as A."""

    serial: int = Field(ge=0, lt=2**53)
    parameters: Values
    pinned: Values | None = None
    start_us: int = Field(ge=-(2**62), le=2**62)
    end_us: int = Field(ge=-(2**62), le=2**62)
    playhead_us: float | None = None


class PresetText(Request):
    """A preset as TOML."""

    text: str = Field(max_length=TEXT_MOST)


class Settings(Request):
    """Parameters, and the clip when it is not the whole recording."""

    parameters: Values
    start_us: int | None = None
    end_us: int | None = None


def parameters_of(values: Values) -> Parameters:
    """The parameters of a request; raises ParameterError that says what is wrong with them."""
    try:
        return Parameters().with_values(values)
    except OverflowError:
        raise ParameterError("a number is too large") from None
