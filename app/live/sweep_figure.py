"""Figure of a camera's bias sweep, as the paper's supplement draws it."""

from __future__ import annotations

from pathlib import Path

from spinscope.pipeline.errors import RecordingError

from ..tuning.bias_sweep import BiasSweep
from .camera_sweep import proposed_value


def write_sweep_figure(sweep: BiasSweep, path: Path) -> None:
    """Draw the event rates of noise and ball, ON and OFF, against the bias; raises RecordingError."""
    from spinscope.pipeline.evaluation.plots import label_axes, panels  # with matplotlib, which takes a second to load

    figure, axes = panels(1, 2)
    values, proposed = [point.value for point in sweep.points], proposed_value(sweep)
    for panel, kind in zip(axes.flat, ("noise", "ball"), strict=True):
        for polarity, colour in (("on", "tab:blue"), ("off", "tab:red")):
            rates_hz = [getattr(point, f"{kind}_{polarity}_hz") for point in sweep.points]
            known = [(value, hz) for value, hz in zip(values, rates_hz, strict=True) if hz is not None]
            if known:
                panel.plot(*zip(*known, strict=True), "o-", color=colour, label=polarity.upper())
        if proposed is not None:
            panel.axvline(proposed, color="green", linewidth=1, label="proposed")
        label_axes(panel, kind, f"bias {sweep.name}", "events [1/s]", log=kind == "noise")
        panel.legend()
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise RecordingError(f"the figure cannot be written ({error}): give another name: {path}") from error
