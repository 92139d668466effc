"""Requests of the page and the answers to them, checked strictly; `static/messages.d.ts` is generated from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from spinscope.app.tuning.bias_sweep import BiasState
from spinscope.app.tuning.optimization import MOST_CLIPS
from spinscope.app.tuning.parameter_sweep import Scale
from spinscope.pipeline.registry import Parameters

Values = dict[str, dict[str, Any]]
TEXT_MOST = 100_000
Microseconds = Annotated[int, Field(ge=-(2**62), le=2**62)]
Span = Annotated[list[Microseconds], Field(min_length=2, max_length=2)]


if TYPE_CHECKING:
    ParameterValues = Parameters
else:
    ParameterValues = Annotated[Values, AfterValidator(Parameters().with_values)]


class Request(BaseModel):
    """Request of the page: unknown fields are refused, and nothing is converted."""

    model_config = ConfigDict(extra="forbid", strict=True)


class OpenRequest(Request):
    """Open a session on a recording of the folder; None for the one the program was started with."""

    recording: str | None = Field(default=None, max_length=1000)


class RunRequest(Request):
    """Run a clip with `parameters`, beside those pinned as A; the request with the highest serial is the newest.

    While a slider is being dragged (`interactive`) a picture without the slowest stages comes first. A preview, at the
    playhead or where the viewer would open, comes before all pictures unless `has_preview` is false. The detail views
    follow the ball of shot number `followed`, from 1, while it flies; by default the tracker's first ball.
    """

    serial: int = Field(ge=0, lt=2**53)
    parameters: ParameterValues
    pinned: ParameterValues | None = None
    start_us: Microseconds
    end_us: Microseconds
    playhead_us: float | None = Field(default=None, allow_inf_nan=False)
    interactive: bool = False
    has_preview: bool = True
    followed: int | None = Field(default=None, ge=1)


class TextRequest(Request):
    """A preset (TOML) or a .bias file to read."""

    text: str = Field(max_length=TEXT_MOST)


class SettingsRequest(Request):
    """Parameters, and the clip when it is not the first one of the recording."""

    parameters: ParameterValues
    start_us: Microseconds | None = None
    end_us: Microseconds | None = None


class SweepRequest(SettingsRequest):
    """Sweep one parameter; without low and high over its whole range."""

    name: str = Field(max_length=100)
    low: float | None = None
    high: float | None = None
    points: int = 15


class OptimizationRequest(SettingsRequest):
    """Optimize some parameters for the clip, or for several clips of the recording, or for several recordings."""

    names: list[str] = Field(max_length=20)
    objective: str = Field(max_length=20)
    trials: int = 40
    clips_us: list[Span] = Field(default=[], max_length=MOST_CLIPS)
    recordings: list[str] = Field(default=[], max_length=MOST_CLIPS)


class CancelRequest(Request):
    """Cancel the job of a kind."""

    kind: Literal["sweep", "optimization", "biases", "bias_sweep"]


class BiasRequest(Request):
    """Biases to simulate the scene with, or to write to a file."""

    biases: dict[str, int]


class BiasSweepRequest(BiasRequest):
    """Sweep a bias, all others as given; for a real recording, whose own biases these may be, measure the folder."""

    is_known: bool = False
    name: str = Field(max_length=20)
    points: int = 9


class Response(BaseModel):
    """Answer of the server."""

    model_config = ConfigDict(extra="forbid")


class Done(Response):
    """Answer without content."""


class Choice(Response):
    """Anything that the page offers by name."""

    name: str
    label: str
    help: str = ""


class MethodInfo(Choice):
    """A spin method with its colour, as CSS."""

    colour: str


class MetricInfo(Response):
    """A metric of a run, shot or estimate: field name, label, unit (% for a share of 0 to 1) and explanation."""

    name: str
    label: str
    unit: str
    help: str


class EventRate(Response):
    """Event rate of the whole recording: counts of bins of equal length, and their edges."""

    counts: list[int]
    edges_us: list[int]


class RecordingDescription(Response):
    """The opened recording, worked on shot by shot if it is long; `clip_us` is the first clip, [start, end)."""

    name: str
    events: int
    width_px: int
    height_px: int
    start_us: int
    end_us: int
    longest_us: int
    is_long: bool
    clip_us: tuple[int, int]
    margin_us: int
    has_truth: bool
    warnings: list[str]
    rate: EventRate


class ControlInfo(Response):
    """Declaration of one parameter, as its control needs it; `is_setup` where it belongs to the set-up."""

    name: str
    label: str
    kind: str
    default: Any
    optional: bool
    unit: str
    low: float | None
    high: float | None
    step: float | None
    choices: list[str]
    help: str
    allowed: str
    scale: Scale
    is_setup: bool


class SectionInfo(Response):
    """A group of controls; `terms` of the glossary explain it, `is_open` where it is unfolded at first."""

    title: str
    terms: Sequence[str]
    is_open: bool
    controls: list[ControlInfo]


class Opening(Response):
    """Everything that the page needs to know at first; without `tools` it shows the viewer alone, `tab` in front.

    The detail views follow the ball of shot number `followed`, if given. `is_live` where a camera runs behind it,
    `has_labels` where labels of the ball can be gone through, which `shows_labels` does at once.
    """

    session: str
    viewer_version: str
    tools: bool
    tab: str
    followed: int | None
    recording: RecordingDescription
    sections: list[SectionInfo]
    stages: list[Choice]
    methods: list[MethodInfo]
    run_metrics: list[MetricInfo]
    shot_metrics: list[MetricInfo]
    estimate_metrics: list[MetricInfo]
    tabs: list[Choice]
    exports: list[Choice]
    objectives: list[Choice]
    suggested: list[str]
    colours: dict[str, str]
    presets: dict[str, Values]
    renamed: dict[str, str]
    biases: BiasState
    is_live: bool
    has_labels: bool
    shows_labels: bool


class ListedRecording(Response):
    """A recording of a folder, or a dropped one; `name` opens it."""

    name: str
    size_bytes: int


class FolderListing(Response):
    """Subfolders and recordings of `folder`, a path within the folder `root` of the machine."""

    root: str
    folder: str
    folders: list[str]
    recordings: list[ListedRecording]


class RecordingSummary(Response):
    """Content of a recording, or `error`; without `shots` where it is too long to be searched for them in passing.

    `spin` tells of the shot with the most logo events, or why there is none; `picture` is the address of a PNG.
    """

    events: int | None = None
    duration_us: int | None = None
    picture: str | None = None
    shots: int | None = None
    spin: str | None = None
    error: str | None = None


class Dropped(Response):
    """The name that opens a dropped file."""

    name: str


class Reopened(Response):
    """The recording after its scene was simulated again."""

    recording: RecordingDescription
    biases: BiasState


class PresetValues(Response):
    """Parameters read from a preset, and notices of former names in it."""

    parameters: Values
    notices: list[str]


class WrittenSettings(Response):
    """Settings as a preset and as a command line; `needs` names a file that the command reads."""

    toml: str
    command: str
    needs: str | None


class BiasValues(Response):
    """Biases read from a file."""

    biases: dict[str, int]


class BiasText(Response):
    """A .bias file."""

    text: str
