"""The requests that the page may make, checked strictly: what is not named here is refused."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.registry import Parameters

Values = dict[str, dict[str, Any]]
TEXT_MOST = 100_000


class Request(BaseModel):
    """Unknown fields are refused, and nothing is taken for what it is not."""

    model_config = ConfigDict(extra="forbid", strict=True)


class OpenPage(Request):
    """A new page, on the recording the program was started with or another one of its folder."""

    recording: str | None = Field(default=None, max_length=255)


class Run(Request):
    """Show a clip with these parameters, beside those pinned as A; in haste while a slider is dragged."""

    serial: int = Field(ge=0, lt=2**53)
    parameters: Values
    pinned: Values | None = None
    start_us: int = Field(ge=-(2**62), le=2**62)
    end_us: int = Field(ge=-(2**62), le=2**62)
    playhead_us: float | None = Field(default=None, allow_inf_nan=False)
    hasty: bool = False


class PresetText(Request):
    """A preset as TOML."""

    text: str = Field(max_length=TEXT_MOST)


class Settings(Request):
    """Parameters, and the clip when it is not the whole recording."""

    parameters: Values
    start_us: int | None = Field(default=None, ge=-(2**62), le=2**62)
    end_us: int | None = Field(default=None, ge=-(2**62), le=2**62)


class Curve(Settings):
    """A tuning curve of one parameter; without low and high over its whole range."""

    name: str = Field(max_length=100)
    low: float | None = None
    high: float | None = None
    points: int = 15


class Search(Settings):
    """Look for better values of some parameters."""

    names: list[str] = Field(max_length=20)
    objective: str = Field(max_length=20)
    trials: int = 40


class Cancel(Request):
    """Stop the work of a kind."""

    kind: str = Field(pattern="^(curve|search|biases|bias_curve)$")


class Biases(Request):
    """Simulate the recording's scene again with these biases."""

    biases: dict[str, int]


class BiasCurve(Request):
    """Rates against one bias, all others as given; of a finished recording those it was taken with, if known."""

    biases: dict[str, int]
    is_known: bool = False
    name: str = Field(max_length=20)
    points: int = 9


class BiasText(Request):
    """A `.bias` file."""

    text: str = Field(max_length=TEXT_MOST)


def parameters_of(values: Values) -> Parameters:
    """The parameters of a request; raises ParameterError that says what is wrong with them."""
    try:
        return Parameters().with_values(values)
    except OverflowError:
        raise ParameterError("a number is too large") from None
