"""Messages between the server and the coach's page; `static/messages.d.ts` is generated from them, too."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from spinscope.app.coach.flight_path import FlightPath
from spinscope.app.coach.statistics import SeriesStatistics
from spinscope.pipeline.cameras import NoticeKind

from .schemas import Request, Response

SHOTS_MOST = 10_000


class Names(Request):
    """Names of a shot; None clears one."""

    player: str | None = None
    wing: str | None = None
    stroke: str | None = None
    drill: str | None = None


class NamesRequest(Request):
    """Set names, marks, or that shots are deleted; what is not given stays."""

    ids: list[int] = Field(max_length=SHOTS_MOST)
    values: dict[str, str | bool | None] = Field(max_length=10)


class StatisticsRequest(Request):
    """Statistics of series by their names: ids of shots by session; see `series_statistics` for `since_s`."""

    series: dict[str, dict[str, list[int]]] = Field(max_length=SHOTS_MOST)
    since_s: float | None = None


class TableRequest(Request):
    """Corners of the table in the picture of a recording, columns and rows in order round the table."""

    recording: str
    corners_px: list[Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(min_length=4, max_length=4)


class WordsQuery(Request):
    """Language and units of what is downloaded."""

    language: Literal["en", "de"] = "en"
    spin_unit: Literal["rps", "rpm"] = "rps"
    speed_unit: Literal["km_h", "m_s"] = "km_h"


class CoachShot(Response):
    """One shot of a session: its columns, and what follows from them."""

    session: str
    id: int
    revision: int
    recording: str
    shot: int
    start_us: int
    end_us: int
    recorded_s: float
    began_by: str
    ended_by: str
    speed_m_s: float | None
    spin_rps: float | None
    spin_std_rps: float | None
    axis_std_deg: float | None
    topspin_rps: float | None
    sidespin_rps: float | None
    corkscrew_rps: float | None
    told_by: Literal["logo", "rhythm", "flight"] | None
    reason: str | None
    has_picture: bool
    player: str | None
    wing: str | None
    stroke: str | None
    drill: str | None
    marked: bool
    deleted: bool
    kind: list[str]
    effect: float | None
    effect_word: Literal["spinny", "neutral", "speedy"] | None
    confidence: Literal["sure", "good", "rough"] | None
    clock_hours: float | None
    corkscrew_share: float | None


class CameraNotice(Response):
    """Incident of a running camera: its kind, of which the page has the words (`camera_...`), and details."""

    kind: NoticeKind | Literal["ended"]
    text: str


class AnalysisState(Response):
    """Work in the background: recordings done of all, those that cannot be read, and what happened to a camera."""

    total: int
    done: int
    is_working: bool
    failures: dict[str, str]
    camera_notice: CameraNotice | None


class SessionShots(Response):
    """The shots of a session that have changed since a revision."""

    revision: int
    shots: list[CoachShot]
    analysis: AnalysisState
    now: Names


class SpinProofPoints(Response):
    """The logo at two instants, and the first turned to the second: places on the disc as the camera sees it."""

    first_us: float
    second_us: float
    first: list[list[float]]
    second: list[list[float]]
    turned: list[list[float]]


class ShotDetail(Response):
    """Drawn details of a shot; directions in the camera frame, `texture` a PNG in base64."""

    shot: CoachShot
    spin_rps: list[float] | None
    reference_us: float
    hitter: list[list[float]] | None
    texture: str | None
    proof: SpinProofPoints | None
    flight: FlightPath | None


class SessionNames(Response):
    """Sessions that are open."""

    sessions: list[str]


class Landings(Response):
    """Places where shots bounced, by id: metres along the table with the flight from the net, and to the left."""

    landings: dict[int, tuple[float, float]]


class TableMarks(Response):
    """Recordings that the table can be marked in, and the present marks.

    `height_m` is that of the camera over the table, `off_px` the largest distance of a corner from where the pose puts
    it; None, like the rest, where no corners are marked.
    """

    recordings: list[str]
    recording: str | None
    corners_px: list[tuple[float, float]] | None
    height_m: float | None
    off_px: float | None


class Statistics(Response):
    """Statistics of series of shots, by their names, and how their middles compare (`compared`)."""

    series: dict[str, SeriesStatistics]
    order: list[str]
    is_clear: bool


class Kept(Response):
    """Revision after a change."""

    revision: int
