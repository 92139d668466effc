"""Figures of the suites: what their legends say is inside the picture."""

from __future__ import annotations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from spinscope.pipeline.evaluation.plots import _legend, panels


@pytest.mark.parametrize(("names", "rows"), [(["a", "b"], 1), (["a long name of a method"] * 4, 2), (["x" * 90], 1)])
def test_a_legend_has_as_many_columns_as_there_is_room_for(names: list[str], rows: int) -> None:
    figure, axes = panels(1, 1)
    for number, name in enumerate(names):
        axes[0, 0].plot([0, 1], [0, 1], label=f"{name} {number}")
    (legend,) = _legend(figure).legends
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = [text.get_window_extent(canvas.get_renderer()) for text in legend.get_texts()]
    assert len({round(box.y0) for box in texts}) == rows
    if len(names) > 1:
        assert min(box.x0 for box in texts) >= 0 and max(box.x1 for box in texts) <= figure.bbox.width
