"""Table of a session's shots for spreadsheets and pandas."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from spinscope.app.table_files import write_table
from spinscope.pipeline.result_rows import ResultRow

from .session import NAMES, ShotSession
from .shot_words import kind_codes
from .terms import clock_hours, confidence, corkscrew_share, spin_effect

_NUMBERS = ("speed_m_s", "spin_rps", "spin_std_rps", "axis_std_deg", "topspin_rps", "sidespin_rps", "corkscrew_rps")
_DERIVED = ("spin_effect", "corkscrew_share", "clock_hours")
_TEXTS = ("began_by", "ended_by", "method", "told_by", "reason", "recording")
COLUMNS: dict[str, type] = {
    "id": int,
    "recorded": str,
    **dict.fromkeys((*NAMES, "kind"), str),
    **dict.fromkeys((*_NUMBERS, *_DERIVED), float),
    "confidence": str,
    "marked": bool,
    **dict.fromkeys(_TEXTS, str),
    "start_us": int,
    "end_us": int,
}


def write_session_table(session: ShotSession, path: Path) -> None:
    """Write all shots that are not deleted as .csv, .parquet or .jsonl; raises SpinscopeError.

    Sidespin is positive to the left, corkscrew to the right, both as the hitter sees them.
    """
    write_table(path, COLUMNS, _rows(session))


def _rows(session: ShotSession) -> Iterator[ResultRow]:
    for shot in session.shots():
        if shot["deleted"]:
            continue
        row: ResultRow = {name: shot[name] for name in COLUMNS if name in shot}
        row["recorded"] = datetime.fromtimestamp(shot["recorded_s"], UTC).isoformat(timespec="milliseconds")
        row["marked"] = bool(shot["marked"])
        spin, speed = shot["spin_rps"], shot["speed_m_s"]
        if spin is not None:
            row["confidence"] = confidence(spin, shot["spin_std_rps"], shot["axis_std_deg"])
            row["spin_effect"] = spin_effect(spin, speed) if speed else None
            row["kind"] = ", ".join(kind_codes(shot))
            if shot["topspin_rps"] is not None:
                row["corkscrew_share"] = corkscrew_share(shot["corkscrew_rps"], spin)
                row["clock_hours"] = clock_hours(shot["topspin_rps"], shot["sidespin_rps"])
        yield row
