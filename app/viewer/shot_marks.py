"""Marks of the shots on the timeline: a lane for each ball in flight, and a list of how they began and ended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from spinscope.pipeline.shots import BEGAN_WORDS, ENDED_WORDS, Shot

from . import entities as at
from .rerun_api import Chunk, columns_at, states
from .run import ViewedRun

NO_SHOT = next(iter(at.SHOT_COLOURS))


def shot_mark_chunks(run: ViewedRun) -> list[Chunk]:
    """Lanes in the colour of how each shot began, and a line of text at each start, contact and end."""
    chunks = _list(run)
    for number, lane in enumerate(_lanes(run.shots), 1):
        times, names = [run.start_us], [NO_SHOT]
        for shot in lane:
            for t_us, name in ((shot.start_us, BEGAN_WORDS[shot.began_by]), (shot.end_us, NO_SHOT)):
                if t_us <= times[-1]:
                    names[-1] = name
                else:
                    times.append(t_us)
                    names.append(name)
        chunks += states(f"{at.SHOTS}/{number}", np.array(times), names, at.SHOT_COLOURS)
    return chunks


def _lanes(shots: Sequence[Shot]) -> list[list[Shot]]:
    """The shots in as few lanes as are needed for those of a lane not to overlap; one at least."""
    lanes: list[list[Shot]] = [[]]
    for shot in shots:
        free = next((lane for lane in lanes if not lane or lane[-1].end_us <= shot.start_us), None)
        if free is None:
            lanes.append([shot])
        else:
            free.append(shot)
    return lanes


def _list(run: ViewedRun) -> list[Chunk]:
    """One line of text at a time: what ends and what begins there."""
    lines: dict[int, list[str]] = {run.start_us: []}
    for number, shot in enumerate(run.shots, 1):
        lines.setdefault(max(shot.start_us, run.start_us), []).append(
            f"shot {number} begins: {BEGAN_WORDS[shot.began_by]}"
        )
        lines.setdefault(min(shot.end_us, run.end_us), []).append(f"shot {number} ends: {ENDED_WORDS[shot.ended_by]}")
    lines[run.start_us] = lines[run.start_us] or [run.no_shot_reason or "no shot yet"]
    times = sorted(lines)
    texts = ["; ".join(lines[t_us]) for t_us in times]
    return [columns_at(at.CONTACTS, np.array(times), rr.TextLog.columns(text=texts))]
