"""Analysis of one recording, as `spinscope analyze` reports it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.flight_calibration import estimate_with_measured_up
from spinscope.pipeline.recordings import Recording
from spinscope.pipeline.session import Choices, Progress, Result, Session

# The fastest hit measured is 116 km/h, 32 m/s (L. Budner, 2016); speeds of a few ticks are known to 10 %.
FASTEST_M_S = 36.0


def analyzed(path: Path, choices: Choices, method: str = "all", on_progress: Progress | None = None) -> Result:
    """The shots of a recording, or its ball on a spinner where there is no flight; raises SpinscopeError.

    See `analyzed_session`.
    """
    return analyzed_session(_opened(path, choices, on_progress), method, on_progress)


def _opened(path: Path, choices: Choices, on_progress: Progress | None) -> Session:
    """Open a recording; raises SpinscopeError, also for times that no camera sends in the unit assumed for them.

    Their analysis would take a thousand times as long and find nothing.
    """
    session = Session.open(path, choices, on_progress)
    if isinstance(session.recording, Recording) and session.recording.time_doubt:
        raise RecordingError(f"{session.recording.time_doubt}: {path}")
    return session


def analyzed_session(session: Session, method: str = "all", on_progress: Progress | None = None) -> Result:
    """The shots of an open recording, or its ball on a spinner where there is no flight.

    Where no shot is trusted, and neither the user nor a sidecar fixed the ball, a ball that turns in place is looked
    for. It counts only if its spin is trusted, and a warning says so, as one says a focal length that is only assumed.
    """
    result = _flights_or_turning_ball(session, method, on_progress)
    if result.shots and not session.states_focal_length:
        result.session.warnings.append(_assumed_focal_length(result))
    result.session.warnings.extend(implausible_speed(result))
    return result


def _assumed_focal_length(result: Result) -> str:
    """Warning about the focal length, with the distance of the ball that follows, by which people check it."""
    camera, session = result.session.parameters.camera, result.session
    places_m = [shot.positions_m(session.camera, session.ball_radius_m) for shot in result.shots]
    distance_m = float(np.median(np.linalg.norm(np.concatenate(places_m), axis=1)))
    return (
        f"nothing states the focal length: {camera.focal_length_mm:g} mm with pixels of {camera.pixel_um:g} um are "
        f"assumed, by which the ball is {distance_m:.2f} m away; if that is wrong, state --set "
        "camera.focal_length_mm=MM and --set camera.pixel_um=UM"
    )


def implausible_speed(result: Result) -> list[str]:
    """Warning about a ball that is faster than any can be, with the options that mend it."""
    session = result.session
    if session.parameters.track.ball == "fixed":
        return []
    velocities_m_s = [shot.velocity_m_s(session.camera, session.ball_radius_m) for shot in result.shots]
    fastest_m_s = max((float(np.linalg.norm(v)) for v in velocities_m_s if v is not None), default=0.0)
    if fastest_m_s <= FASTEST_M_S:
        return []
    return [
        f"a ball flies at {fastest_m_s:.0f} m/s, faster than any that was measured (32 m/s): state the unit of the "
        "times (--time-unit s|ms|us|ns) or the ball's diameter (--set ball.diameter_mm=MM)"
    ]


def _flights_or_turning_ball(session: Session, method: str, on_progress: Progress | None) -> Result:
    result = estimate_with_measured_up(session, method, on_progress)
    if session.parameters.track.ball == "fixed" or any(shot.best for shot in result.shots):
        return result
    in_place = dataclasses.replace(session, warnings=list(session.warnings))
    try:
        in_place.place_fixed_ball("auto")
    except RecordingError:
        return result
    turning = in_place.estimate(method, on_progress)
    if not any(shot.best for shot in turning.shots):
        return result
    in_place.warnings.append("no flight is trusted in this recording: taken as a ball that turns in place on a spinner")
    return turning


def report_on(
    path: Path,
    choices: Choices,
    method: str,
    on_progress: Progress | None = None,
    on_open: Callable[[Session], None] | None = None,
    *,
    cold: bool = True,
) -> tuple[dict[str, Any], Result]:
    """The JSON report on one recording (tests/app/analyze.schema.json) and its result; raises SpinscopeError.

    Parameters
    ----------
    path : Path
        The recording.
    choices : Choices
        Options of the command line.
    method : str
        Name of a spin method, or "all".
    on_progress : callable, optional
        Told the share done and what is being done.
    on_open : callable, optional
        Given the open recording before it is analyzed, with the warnings known by then.
    cold : bool
        Whether this is the process's first; loading the kernels is then told apart from the work itself.
    """
    begin = time.perf_counter()
    session = _opened(path, choices, on_progress)
    if on_open:
        on_open(session)
    load_seconds = session.load_kernels(method) if cold else 0.0
    result = analyzed_session(session, method, on_progress)
    report = result.to_dict()
    report["recording"]["path"] = str(path)
    report["seconds"] |= {"load": load_seconds, "total": time.perf_counter() - begin}
    return report, result
