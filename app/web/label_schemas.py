"""Messages between the server and the page about labels of the ball."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .schemas import Request, Response

MOST_LABELS = 1000  # of one change: a flight of 2.5 s
Number = Annotated[float, Field(allow_inf_nan=False)]


class Label(Request):
    """A labelled place of the ball: scene time, silhouette, its error, number of the flight from 1."""

    t_us: Number
    x_px: Number
    y_px: Number
    radius_px: float = Field(gt=0.0, allow_inf_nan=False)
    std_px: Number
    ball: int = Field(ge=1)
    state: Literal["detected", "accepted", "moved"]


class Labels(Response):
    """All labels of the recording, in order of time, flight by flight; a change names the `version` that it is of."""

    path: str
    version: str
    labels: list[Label]


class LabelChangeRequest(Request):
    """Put labels in the place of `removed` others from number `first` on, which counts from 0."""

    version: str = Field(max_length=100)
    first: int = Field(ge=0)
    removed: int = Field(ge=0, le=MOST_LABELS)
    labels: list[Label] = Field(max_length=MOST_LABELS)


class LabelVersion(Response):
    """Version of the labels after a change."""

    version: str
