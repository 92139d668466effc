"""Golden numbers of the sample recordings: `uv run python -m tests.golden.make` writes them anew.

Run it after a change that is meant to change results, and read the difference before committing it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import SAMPLES, Choices, Session
from spinscope.pipeline.shots import Shot

FILE = Path(__file__).with_name("samples.json")


def numbers(path: Path) -> dict[str, Any]:
    """Numbers of one sample, from its events to its spins and their stated errors, as JSON holds them."""
    truth = open_recording(path).truth
    assert truth is not None
    fixed = bool(np.ptp(truth.x_px) == 0)
    ball = (float(truth.x_px[0]), float(truth.y_px[0]), float(truth.radius_px[0]))
    session = Session.open(path, Choices(fixed_ball=ball if fixed else None))
    result = session.estimate_keeping_ticks()
    ticks = result.ticks
    events = session.source.events
    return {
        "events": [len(events), int(events.x_px.sum()), int(events.y_px.sum()), int(events.on.sum())],
        "surface_events": sum(len(tick.filter.surface_events) for tick in ticks),
        "logo_filter_events": sum(len(tick.filter.logo_events) for tick in ticks),
        "surface_sum": int(ticks[len(ticks) // 2].surface.values.sum(dtype=np.int64)),
        "shots": [
            {
                "us": [shot.start_us, shot.end_us],
                "logo_events": shot.logo_events,
                "mean_state": np.round(shot.state.mean(axis=0), 3).tolist(),
                "mean_std": np.round(shot.std.mean(axis=0), 4).tolist(),
                "measured": int(shot.measured.sum()),
                "velocity_m_s": _velocity_m_s(session, shot),
                "spin_rps": {
                    name: None if one.vector_rps is None else np.round(one.vector_rps, 3).tolist()
                    for name, one in shot.estimates.items()
                },
                "spin_std": {name: _stated_errors(one) for name, one in shot.estimates.items()},
                "best": shot.best,
            }
            for shot in result.shots
        ],
    }


def _velocity_m_s(session: Session, shot: Shot) -> list[float] | None:
    velocity = shot.velocity_m_s(session.camera, session.ball_radius_m)
    return None if velocity is None else np.round(velocity, 3).tolist()


def _stated_errors(estimate: SpinEstimate) -> list[float] | None:
    """1 sigma of magnitude (rps) and axis (degrees); None where the method refused."""
    if estimate.magnitude_std_rps is None or estimate.axis_std_deg is None:
        return None
    return [round(estimate.magnitude_std_rps, 4), round(estimate.axis_std_deg, 3)]


def samples() -> list[Path]:
    """The sample recordings, by name."""
    return sorted(SAMPLES.glob("*.h5"))


if __name__ == "__main__":
    FILE.write_text(json.dumps({path.stem: numbers(path) for path in samples()}, indent=1) + "\n", encoding="utf-8")
