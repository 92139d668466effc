"""Shots beside the truth of free flights: which shot is whose, and whether its answer is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..results import spin_errors
from ..session import Result
from ..shots import Shot
from ..simulator import SimulatedRecording
from ..simulator.segments import Segment
from ..simulator.simulation import truth_of
from .estimation import BEST
from .tables import Row
from .uncertainty_calibration import ERRORS, STATED, is_right, is_within_stated

SHORTEST_US = 20_000  # of flights that are asked for: four ticks
BOTH_US = 7_500  # a shot has part in two flights from this much of each: a tick, and the 2 ms that a contact may be off
RIGHT, WRONG, MIXED, REFUSED, MISSED = OUTCOMES = ("right", "wrong", "two spins for one", "refused", "missed")
INVENTED = "of no flight"  # outcome of a trusted answer to what is no flight


@dataclass(frozen=True)
class SegmentMatch:
    """A segment of the truth, and the shots that are of it, the longest first."""

    segment: Segment
    shots: list[Shot] = field(default_factory=list)
    mixed: set[int] = field(default_factory=set)  # places in `shots` of those with part in another segment


def matches(recording: SimulatedRecording, shots: Sequence[Shot]) -> tuple[list[SegmentMatch], list[Shot]]:
    """Every segment with its shots, and the shots of no flight.

    A shot is the ball's whose circle it is in most of its ticks, and the segment's that it shares most time with.
    """
    found = [SegmentMatch(segment) for segment in recording.segments]
    nobody = []
    for shot in sorted(shots, key=lambda shot: shot.start_us - shot.end_us):
        ball = _ball_of(recording, shot)
        shared = [_shared_us(shot, match.segment) if match.segment.ball == ball else 0 for match in found]
        best = int(np.argmax(shared)) if shared else 0
        if not shared or shared[best] == 0:
            nobody.append(shot)
            continue
        if sum(us >= BOTH_US for us in shared) > 1:
            found[best].mixed.add(len(found[best].shots))
        found[best].shots.append(shot)
    return found, nobody


def _shared_us(shot: Shot, segment: Segment) -> int:
    return max(min(shot.end_us, segment.end_us) - max(shot.start_us, segment.start_us), 0)


def _ball_of(recording: SimulatedRecording, shot: Shot) -> int | None:
    """Number of the ball whose circle the shot's is in most of its ticks, None where there is none."""
    distances = []
    for ball in range(len(recording.scene.balls)):
        truth = truth_of(recording.scene, recording.camera, recording.truth.label, ball)
        path = (np.interp(shot.t_us, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px))
        x, y, radius = path
        away_px = np.hypot(shot.state[:, 0] - x, shot.state[:, 1] - y)
        distances.append(float(np.median(away_px / radius)))
    nearest = int(np.argmin(distances)) if distances else 0
    return nearest if distances and distances[nearest] < 1 else None


def segment_rows(recording: SimulatedRecording, result: Result, about: Row) -> list[Row]:
    """One row a free flight and method, and one for each trusted answer to what is no flight.

    Columns beside `about`, errors and stated errors: `ball`, `rps`, `logo_events`, `outcome` (of OUTCOMES), `reason`,
    `by` (method of the answer), `pieces` (shots of this flight), `found_ms` (from where the flight begins to the shot's
    first tick), `begin_ms` and `end_ms` (errors of the shot's ends where the flight has a contact there, else None).
    """
    rows: list[Row] = []
    found, nobody = matches(recording, result.shots)
    methods = list(result.shots[0].estimates) if result.shots else []
    for match in found:
        segment = match.segment
        if segment.end_us - segment.start_us < SHORTEST_US:
            continue
        if not segment.is_shot:
            nobody += match.shots
            continue
        shot = match.shots[0] if match.shots else None
        common: Row = {**about, "ball": segment.ball, "rps": float(np.linalg.norm(segment.spin_rps))}
        common |= {"logo_events": segment.logo_events, "pieces": len(match.shots)}
        common |= dict.fromkeys(("by", "found_ms", "begin_ms", "end_ms", *ERRORS, *STATED, "reason"))
        if shot is None:
            common |= {"outcome": MISSED, "reason": result.no_shot_reason or "no shot of this flight"}
        else:
            common["found_ms"] = max(shot.start_us - segment.start_us, 0) / 1000
            if segment.began_by in ("bounce", "hit"):
                common["begin_ms"] = abs(shot.start_us - segment.start_us) / 1000
            if segment.ended_by in ("bounce", "hit"):
                common["end_ms"] = abs(shot.end_us - segment.end_us) / 1000
        for method in (*methods, BEST):
            answer = {} if shot is None else _answer(shot, method, segment, 0 in match.mixed)
            rows.append(common | {"method": method} | answer)
    for shot in nobody:
        if shot.best is not None:
            row: Row = {**about, "ball": None, "rps": None, "logo_events": shot.logo_events, "pieces": 1}
            row |= dict.fromkeys(("by", "found_ms", "begin_ms", "end_ms", *ERRORS, *STATED, "reason"))
            rows.append(row | {"method": BEST, "outcome": INVENTED})
    return rows


def _answer(shot: Shot, method: str, segment: Segment, mixed: bool) -> Row:
    """Outcome and errors of one method's answer."""
    name = shot.best if method == BEST else method
    if name is None:
        return {"outcome": REFUSED, "reason": shot.best_reason}
    estimate = shot.estimates[name]
    if estimate.vector_rps is None:
        return {"outcome": REFUSED, "reason": estimate.reason}
    row: Row = {"by": name, "rps": float(np.linalg.norm(segment.spin_rps))}
    errors = spin_errors(estimate.vector_rps, np.array(segment.spin_rps))
    row |= zip(ERRORS, errors, strict=True)
    row |= zip(STATED, (estimate.magnitude_std_rps, estimate.axis_std_deg), strict=True)
    # A flight's own answer counts where the program gives it for want of a logo, not as a rival of the logo's.
    by_flight = name == "combined" and shot.combined is not None and shot.combined.basis == "flight"
    by_flight = by_flight or (method == BEST and name == "trajectory")
    right = is_within_stated(estimate, *errors) if by_flight else is_right(row)
    return row | {"outcome": MIXED if mixed else RIGHT if right else WRONG}
