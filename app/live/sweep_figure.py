"""Figure of a camera's bias sweep, as the paper's supplement draws it."""

from __future__ import annotations

from pathlib import Path

from spinscope.pipeline.errors import RecordingError

from ..tuning.bias_sweep import BiasSweep
from ..viewer import entities


def write_sweep_figure(sweep: BiasSweep, proposed: int | None, path: Path) -> None:
    """Draw the event rates of noise and ball, ON and OFF, against the bias; raises RecordingError."""
    from spinscope.pipeline.evaluation.plots import label_axes, panels  # with matplotlib, which takes a second to load

    figure, axes = panels(1, 2)
    values = [point.value for point in sweep.points]
    for panel, kind in zip(axes.flat, ("noise", "ball"), strict=True):
        for polarity, rgb in (("on", entities.ON), ("off", entities.OFF)):
            colour = [part / 255 for part in rgb]
            rates_hz = [getattr(point, f"{kind}_{polarity}_hz") for point in sweep.points]
            known = [(value, hz) for value, hz in zip(values, rates_hz, strict=True) if hz is not None]
            if known:
                panel.plot(*zip(*known, strict=True), "o-", color=colour, label=polarity.upper())
        if proposed is not None:
            panel.axvline(proposed, color="green", linewidth=1, label="proposed")
        label_axes(panel, kind, f"bias {sweep.name}", "events [1/s]", log=kind == "noise")
        if kind == "ball":  # on the page, too
            panel.set_ylim(bottom=0.0)
        panel.legend()
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise RecordingError(f"the figure cannot be written ({error}): give another name: {path}") from error
