"""Shots for tests, without an analysis."""

from __future__ import annotations

from typing import Any

from spinscope.app.coach.session import KnownRecording
from spinscope.app.coach.shot_record import RecordingShots, ShotRecord

# Of a shot whose spin and flight are not drawn.
NO_DETAIL = (
    '{"path": {"t_us": [], "x_m": [], "y_m": [], "z_m": []}, "hitter": null, "spin_rps": null, "depth_std_m": 0, '
    '"line_of_sight": [0, 0, 1], "reference_us": 0, "texture": null, "proof": null}'
)
KNOWN = KnownRecording("content", "settings", "version", None)


def shot(number: int = 1, start_us: int = 0, end_us: int = 100_000, **others: Any) -> ShotRecord:
    """A topspin of 50 rps at 10 m/s."""
    values: dict[str, Any] = {
        "recording": "day.raw",
        "recording_hash": "content",
        "recorded_s": 1.7e9 + end_us * 1e-6,
        "began_by": "entered",
        "ended_by": "left",
        "speed_m_s": 10.0,
        "spin_rps": 50.0,
        "spin_std_rps": 0.5,
        "axis_std_deg": 2.0,
        "topspin_rps": 50.0,
        "sidespin_rps": 0.0,
        "corkscrew_rps": 0.0,
        "method": "contrast",
        "told_by": "logo",
        "detail": NO_DETAIL,
    }
    return ShotRecord(**{**values, "shot": number, "start_us": start_us, "end_us": end_us, **others})


def analysis(*shots: ShotRecord, reason: str | None = None) -> RecordingShots:
    """An analysis that found these shots."""
    return RecordingShots(shots, reason, ())
