"""Results as rows of tables, for spreadsheets and pandas: one row a shot, and one row a tick of a shot."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from .errors import RecordingError
from .registry import methods
from .results import SpinEstimate, Truth, Vector, spin_errors
from .session import Result, Session
from .shots import Shot
from .spin_terms import kind_of_spin

Value = str | int | float | bool | None
ResultRow = dict[str, Value]

# Columns and their types. `shot` counts from 1; `best` is the trusted method, whose spin stands in the columns without
# a method's name; sidespin is positive to the left of the flight. Errors are those against the truth.
PROVENANCE: dict[str, type] = {
    "recording": str,
    "recording_hash": str,
    "sidecar_hash": str,
    "settings_hash": str,
    "version": str,
}
_SHOT: dict[str, type] = {
    "shot": int,
    "shots": int,
    "start_us": int,
    "end_us": int,
    "began_by": str,
    "ended_by": str,
    "fixed_ball": bool,
    "distance_m": float,
    "speed_m_s": float,
    "logo_events": int,
    "best": str,
    "best_reason": str,
    "witnesses": str,
    "kind": str,
}
_SPIN = ("x_rps", "y_rps", "z_rps", "magnitude_rps")
_STATED = ("magnitude_std_rps", "axis_std_deg")
_PARTS = {"topspin_rps": "topspin", "sidespin_rps": "left sidespin", "corkscrew_rps": "corkscrew"}
_TRUE = tuple(f"true_{name}" for name in _SPIN)
_ERRORS = ("error_rps", "error_deg")
_TICK: dict[str, type] = {
    "shot": int,
    "t_us": int,
    **dict.fromkeys(("x_px", "y_px", "radius_px", "vx_px_s", "vy_px_s", "x_m", "y_m", "z_m"), float),
    "measured": bool,
    "logo_rate_hz": float,
    "rate_rps": float,
}


def shot_columns(run: Collection[str] = ()) -> dict[str, type]:
    """Name and type of each column of `shot_rows`, with the provenance before and what went wrong behind.

    `run` names the methods that were asked for: rivals have columns only where they are among them.
    """
    columns = {**PROVENANCE, **_SHOT, **dict.fromkeys((*_SPIN, *_STATED, *_PARTS, *_TRUE, *_ERRORS), float)}
    columns["truth_from"] = str
    for method in _method_names(run):
        columns |= {f"{method}_{name}": float for name in (*_SPIN, *_STATED, *_ERRORS)}
        columns[f"{method}_reason"] = str
    return {**columns, "no_shot_reason": str, "warnings": str, "error": str}


def tick_columns(run: Collection[str] = ()) -> dict[str, type]:
    """Name and type of each column of `tick_rows`, with the recording before; `run` as of `shot_columns`."""
    estimates = {f"{method}_{name}": float for method in _method_names(run) for name in (*_SPIN, *_STATED)}
    return {"recording": str, **_TICK, **estimates}


def _method_names(run: Collection[str]) -> list[str]:
    return [method.name for method in methods() if not method.is_rival or method.name in run]


def shot_rows(result: Result) -> list[ResultRow]:
    """One row a shot, without its provenance; one that says why where there is no shot.

    The truth is that of the sidecar where it states one and there is one shot, else the simulator's, for shots of the
    ball that it is of.
    """
    session = result.session
    report = result.to_dict()
    truth, doubts = _simulated_truth(session)
    warnings = "; ".join([*session.warnings, *doubts]) or None
    if not result.shots:
        return [{"shots": 0, "no_shot_reason": result.no_shot_reason, "warnings": warnings}]
    return [
        {"shot": number, "shots": len(result.shots), **_shot_row(result, shot, written, truth), "warnings": warnings}
        for number, (shot, written) in enumerate(zip(result.shots, report["shots"], strict=True), start=1)
    ]


def tick_rows(result: Result) -> list[ResultRow]:
    """One row a tick of each shot: circle, place, rates, and each method's spin from the shot's events up to there."""
    session = result.session
    rows: list[ResultRow] = []
    for number, shot in enumerate(result.shots, start=1):
        history = shot.history
        if history is None:
            continue
        places_m = shot.positions_m(session.camera, session.ball_radius_m)
        for tick, (t_us, state, place_m, measured) in enumerate(
            zip(shot.t_us, shot.state, places_m, shot.measured, strict=True)
        ):
            row: ResultRow = {"shot": number, "t_us": round(t_us), "measured": bool(measured)}
            row |= zip(("x_px", "y_px", "vx_px_s", "vy_px_s", "radius_px"), map(float, state), strict=True)
            row |= zip(("x_m", "y_m", "z_m"), map(float, place_m), strict=True)
            for name, value in (("logo_rate_hz", history.logo_rate_hz[tick]), ("rate_rps", history.rate_rps[tick])):
                row[name] = None if np.isnan(value) else float(value)
            for estimate in history.estimates(tick):
                if result.method in ("all", estimate.method) or estimate.method in session.chain.rivals:
                    row |= {f"{estimate.method}_{name}": value for name, value in _numbers(estimate).items()}
            rows.append(row)
    return rows


def _simulated_truth(session: Session) -> tuple[Truth | None, list[str]]:
    """The simulator's truth, and a warning where it is damaged: the shots are no worse for that."""
    try:
        return session.truth, []
    except RecordingError as error:
        return None, [str(error)]


def _shot_row(result: Result, shot: Shot, written: dict[str, Any], truth: Truth | None) -> ResultRow:
    """The row of a shot; `written` is the shot as JSON, of the methods that were asked for."""
    session, best = result.session, written["best"]
    names = ("start_us", "end_us", "began_by", "ended_by", "speed_m_s", "logo_events", "best", "best_reason")
    row: ResultRow = {name: written[name] for name in names}
    places_m = shot.positions_m(session.camera, session.ball_radius_m)
    row["distance_m"] = float(np.linalg.norm(places_m, axis=1).mean())
    row["fixed_ball"] = is_fixed = session.parameters.track.ball == "fixed"
    row["witnesses"] = " ".join(one["witness"] for one in written["witnesses"]) or None
    true_spin, true_rps, row["truth_from"] = _truth(result, shot, truth)
    if true_rps is not None:
        row |= dict(zip(_TRUE, (*((None,) * 3 if true_spin is None else true_spin.tolist()), true_rps), strict=True))
    for method in written["spin"]:
        estimate = shot.estimates[method]
        numbers = _numbers(estimate) | _errors(estimate, true_spin, true_rps)
        row |= {f"{method}_{name}": value for name, value in numbers.items()}
        row[f"{method}_reason"] = estimate.reason
        if method == best and estimate.vector_rps is not None:
            velocity = None if is_fixed else shot.velocity_m_s(session.camera, session.ball_radius_m)
            kind = kind_of_spin(estimate.vector_rps, velocity, session.camera.up)
            row |= numbers | {"kind": kind.name}
            row |= {column: kind.parts_rps.get(part) for column, part in _PARTS.items()}
    return row


def _numbers(estimate: SpinEstimate) -> ResultRow:
    """Spin and stated errors by column, none where the method refused."""
    if estimate.vector_rps is None:
        return {}
    spin = (*map(float, estimate.vector_rps), estimate.magnitude_rps)
    return dict(zip((*_SPIN, *_STATED), (*spin, estimate.magnitude_std_rps, estimate.axis_std_deg), strict=True))


def _errors(estimate: SpinEstimate, true_spin: Vector | None, true_rps: float | None) -> ResultRow:
    if estimate.vector_rps is None or estimate.magnitude_rps is None or true_rps is None:
        return {}
    if true_spin is None or true_rps == 0:  # no axis to compare with
        return {_ERRORS[0]: abs(estimate.magnitude_rps - true_rps)}
    return dict(zip(_ERRORS, spin_errors(estimate.vector_rps, true_spin), strict=True))


def _truth(result: Result, shot: Shot, simulated: Truth | None) -> tuple[Vector | None, float | None, str | None]:
    """True spin (3,) in rps at the middle of a shot, its magnitude, and where they are from; None where not known."""
    stated = result.session.sidecar.truth
    if stated is not None:
        if len(result.shots) > 1:
            return None, None, None
        return None if stated.spin_rps is None else np.array(stated.spin_rps), stated.rps, "sidecar"
    if simulated is None or not simulated.t_us.size:
        return None, None, None
    columns = (simulated.x_px, simulated.y_px, simulated.radius_px)
    x, y, radius = (np.interp(shot.t_us, simulated.t_us, column) for column in columns)
    off = np.median(np.hypot(shot.state[:, 0] - x, shot.state[:, 1] - y) / radius)
    if not off < 1:  # another ball's, or the truth says nothing of its place
        return None, None, None
    middle_us = (shot.start_us + shot.end_us) / 2
    spin = np.array([np.interp(middle_us, simulated.t_us, simulated.spin_rps[:, axis]) for axis in range(3)])
    return spin, math.hypot(*spin), "simulator"
