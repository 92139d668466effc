"""Suite `filters`: events kept by STC, TRAIL and STC-cut-TRAIL (supplement), and what each does to the spin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...chain import Chain
from ...events import EventBatch
from ...registry import STAGES, Parameters
from ...results import Packet
from ..estimation import COLUMNS, chain_over, estimate_rows, estimated, method_lines
from ..lab_recordings import FLIGHT, LabRecording
from ..plots import LABELS, Figures, curve, label_axes, panels
from ..tables import Cell, ResultTable, Row, Value, distinct, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS
from .thrower import flight_of, flights

LABEL = "Filters: events kept, and the spin"
HELP = "Events that each filter keeps, and what that does to the spin (supplement)."

TAKES_SCENE_CHOICES = True
REAL_KINDS = (FLIGHT,)

FILTERS = ("stc", "trail", "stc_cut_trail")
THRESHOLDS_US = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)
SPIN_THRESHOLDS_US = (1000, 5000, 20_000)
EVERY = 8  # every so many of the thrower's flights are taken
NOISE, BALL, LOGO = (0, 4), (1, 2), (2,)  # labels of the truth


def tasks(quick: bool) -> list[Task]:
    """One flight and one question a task."""
    chosen = flights(quick)[:1] if quick else flights(quick)[::EVERY]
    thresholds = SPIN_THRESHOLDS_US[1:2] if quick else SPIN_THRESHOLDS_US
    kept = [Task(measure_kept, flight) for flight in chosen]
    spin = [
        Task(measure_spin, {**flight, "mode": mode, "threshold_us": threshold_us})
        for flight in chosen
        for mode, threshold_us in _filters(thresholds)
    ]
    return kept + spin


def measure_kept(context: TaskContext, **flight: Any) -> list[Row]:
    """The share of events that each filter keeps at each threshold, by cause."""
    recording, about = flight_of(context, **flight)
    packet = Packet(0, 0, recording.duration_us, recording.events)
    return _kept_rows(chain_over(recording), context.parameters, packet, recording.truth.label, about["seed"])


def _kept_rows(
    chain: Chain, parameters: Parameters, packet: Packet, label: NDArray[np.uint8] | None, seed: Value
) -> list[Row]:
    """Shares kept of a packet's events; by cause where they have labels (n,)."""
    rows: list[Row] = []
    for mode in FILTERS:
        for threshold_us in THRESHOLDS_US:
            filter_parameters = parameters.filter.with_values(
                {"mode": mode, "threshold_us": threshold_us, "logo_mode": mode, "logo_threshold_us": threshold_us}
            )
            stage = STAGES["filter"]
            state = chain.start(parameters.with_groups(filter=filter_parameters), stage)
            passed = stage.step(filter_parameters, state, packet).surface_events
            kept = np.isin(_keys(packet.events), _keys(passed))
            row: Row = {"question": "kept", "seed": seed, "mode": mode, "threshold_us": threshold_us}
            row["kept_all"] = float(kept.mean())
            for name, labels in (("noise", NOISE), ("ball", BALL), ("logo", LOGO)):
                of_these = None if label is None else np.isin(label, labels)
                row[f"kept_{name}"] = None if of_these is None or not of_these.any() else float(kept[of_these].mean())
            rows.append(row)
    return rows


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """Both questions about a real flight; the events' causes are not known."""
    truth, session = recording.stated, recording.session
    start_us, end_us = session.source.start_us, session.source.end_us
    packet = Packet(0, start_us, end_us, session.source.between(start_us, end_us))
    rows = _kept_rows(session.chain, session.parameters, packet, None, None)
    for mode, threshold_us in _filters(SPIN_THRESHOLDS_US):
        filtered = {"filter": {"logo_mode": mode, "logo_threshold_us": threshold_us}}
        result = replace(session, parameters=session.parameters.with_values(filtered)).estimate()
        about: Row = {"question": "spin", "mode": mode, "threshold_us": threshold_us, "rps": truth.rps}
        rows += estimate_rows(result, truth, about | {"visible": None})
    return rows


def _filters(thresholds_us: Sequence[int]) -> list[tuple[str, int]]:
    return [("off", 1), *((mode, threshold_us) for mode in FILTERS for threshold_us in thresholds_us)]


def measure_spin(context: TaskContext, mode: str, threshold_us: int, **flight: Any) -> list[Row]:
    """The errors of the spin with this filter before the logo and the outline."""
    recording, about = flight_of(context, **flight)
    parameters = context.parameters.with_values({"filter": {"logo_mode": mode, "logo_threshold_us": threshold_us}})
    about |= {"question": "spin", "mode": mode, "threshold_us": threshold_us}
    return estimate_rows(estimated(recording, parameters), recording.truth, about)


def _keys(events: EventBatch) -> NDArray[np.int64]:
    """(n,) one number an event, different for different events (pixels up to 2047)."""
    key: NDArray[np.int64] = events.t_us
    for column, size in ((events.y_px, 2048), (events.x_px, 2048), (events.on, 2)):
        key = key * size + column.astype(np.int64)
    return key


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Events kept against the threshold; spin errors against filter and threshold."""
    kept = where(rows, question="kept")
    shares = ("kept_all", "kept_ball", "kept_logo", "kept_noise")
    of_kept: list[tuple[Cell, ...]] = [
        (mode, threshold_us, *(summary(part, name) for name in shares))
        for mode in FILTERS
        for threshold_us in distinct(kept, "threshold_us")
        if (part := where(kept, mode=mode, threshold_us=threshold_us))
    ]
    spin = where(rows, question="spin")
    of_spin = [
        line
        for mode in ("off", *FILTERS)
        for threshold_us in sorted(distinct(spin, "threshold_us"))
        for line in method_lines(
            where(spin, mode=mode, threshold_us=threshold_us), mode, None if mode == "off" else threshold_us
        )
    ]
    return [
        ResultTable(
            "Events kept by the filters, flying ball",
            ("filter", "threshold [us]", "all", "ball", "logo", "noise"),
            of_kept,
            "Shares of the events that come in. The paper: STC keeps more with a longer threshold, TRAIL fewer, and "
            "beyond 5,000 us little changes for both together.",
        ),
        ResultTable("Spin with each filter before the logo", ("filter", "threshold [us]", *COLUMNS), of_spin),
    ]


def figures(rows: Sequence[Row]) -> Figures:
    """Events kept against the threshold (the supplement's figure), and the spin's errors."""
    figure, axes = panels(1, 3)
    kept, spin = where(rows, question="kept"), where(rows, question="spin")
    for color, mode in enumerate(FILTERS):
        for name, style in (("kept_ball", "-"), ("kept_noise", ":")):
            label = f"{mode}, {name.removeprefix('kept_')}"
            curve(axes[0, 0], where(kept, mode=mode), "threshold_us", name, label, style, color)
        for panel, name in zip(axes[0, 1:], ERRORS, strict=True):
            for method, style in (("contrast", "-"), ("triplet", "--")):
                part = where(spin, mode=mode, method=method)
                curve(panel, part, "threshold_us", name, f"{mode}, {method}", style, color, band=False)
    for panel, label in zip(axes[0], ("share of events kept", *LABELS), strict=True):
        panel.set_xscale("log")
        label_axes(panel, "flying ball", "threshold [us]", label, log=label in LABELS)
    return {"thresholds": figure}
