"""Opening of a session: all names, labels, colours and choices that the page shows, from where they are declared."""

from __future__ import annotations

import dataclasses

from spinscope.app.tuning.bias_sweep import bias_state
from spinscope.app.tuning.optimization import OBJECTIVES, SUGGESTED
from spinscope.app.viewer import entities
from spinscope.app.viewer.views import VIEWS, views
from spinscope.pipeline.metrics import EstimateMetrics, RunMetrics, ShotMetrics
from spinscope.pipeline.registry import STAGES, methods

from . import presets
from .app_state import AppState
from .assets import viewer_version
from .client_session import ClientSession
from .controls import sections
from .exports import EXPORTS
from .open_recording import MARGIN_US, RATE_BINS, OpenRecording
from .publisher import DRAWING
from .schemas import Choice, EventRate, MethodInfo, MetricInfo, Opening, RecordingDescription


def opening(state: AppState, session: ClientSession) -> Opening:
    """Everything that the page of a new session needs to know."""
    recording = session.runner.recording
    opened, run = recording.session.parameters, recording.session.chain.stages
    objectives = {name: label for name, label in OBJECTIVES.items() if name != "truth" or recording.session.truth}
    return Opening(
        session=session.id,
        viewer_version=viewer_version(),
        tools=state.tools,
        tab=VIEWS[state.layout].label,
        followed=state.followed,
        recording=recording_description(recording, state.folders.name_of(recording.original)),
        sections=sections(),
        stages=[
            *(Choice(name=stage.name, label=stage.label, help=stage.help) for stage in STAGES if stage.name in run),
            Choice(name=DRAWING, label="Drawing", help="Pictures of the viewer."),
        ],
        methods=[
            MethodInfo(name=method.name, label=method.label, help=method.help, colour=_css(method.colour))
            for method in methods()
            if method.name in run
        ],
        run_metrics=_metrics(RunMetrics),
        shot_metrics=_metrics(ShotMetrics),
        estimate_metrics=_metrics(EstimateMetrics),
        tabs=[Choice(name=view.name, label=view.label, help=view.help) for view in views(compare=state.tools)],
        exports=[Choice(name=name, label=export.label) for name, export in EXPORTS.items()],
        objectives=[Choice(name=name, label=label) for name, label in objectives.items()],
        suggested=list(SUGGESTED),
        colours={"on": _css(entities.ON), "off": _css(entities.OFF), "plain": _css(entities.KALMAN_COLOUR)},
        presets=presets.built_in(opened),
        renamed=opened.renamed(),
        biases=bias_state(recording.session.recording) if state.live is None else state.live.bias_state(),
        is_live=state.live is not None,
        has_labels=state.labels_of(recording).path.is_file(),
        shows_labels=state.labels is not None and recording.original == state.path,
    )


def recording_description(recording: OpenRecording, name: str) -> RecordingDescription:
    """The recording as the page describes it, under the name by which it is opened."""
    session = recording.session
    counts, edges_us = recording.rate(RATE_BINS)
    start_us, end_us = recording.window_us
    return RecordingDescription(
        name=name,
        events=session.source.event_count,
        width_px=session.source.width_px,
        height_px=session.source.height_px,
        start_us=start_us,
        end_us=end_us,
        longest_us=recording.longest_us,
        is_long=recording.is_long,
        clip_us=recording.first_clip_us(),
        margin_us=MARGIN_US,
        has_truth=session.truth is not None,
        warnings=session.warnings,
        rate=EventRate(counts=counts.tolist(), edges_us=edges_us.tolist()),
    )


def _metrics(metrics: type[RunMetrics | ShotMetrics | EstimateMetrics]) -> list[MetricInfo]:
    declared = [field for field in dataclasses.fields(metrics) if field.metadata]
    return [MetricInfo(name=field.name, **field.metadata) for field in declared]


def _css(colour: entities.Colour) -> str:
    return f"#{colour[0]:02x}{colour[1]:02x}{colour[2]:02x}"
