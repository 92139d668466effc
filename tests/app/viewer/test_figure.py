"""Figure of the series for a publication."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.figure import BRIGHTEST, printed_colour, series_figure
from spinscope.app.viewer.run import ViewedRun


def test_svg_and_pdf_hold_every_curve(flight: ViewedRun) -> None:
    text = series_figure(flight, ".svg", pinned=flight).decode()
    ElementTree.fromstring(text)
    for words in ("x [px]", "Spin [rps]", "Axis error", "Contrast maximisation", "A: Contrast maximisation", "truth"):
        assert f"<!-- {words}" in text, words
    assert "A: truth" not in text
    assert series_figure(flight, ".pdf").startswith(b"%PDF")


@pytest.mark.parametrize("colour", [entities.HOUGH_COLOUR, entities.RATE_COLOUR, entities.TRUTH_COLOUR])
def test_colours_are_seen_on_white(colour: entities.Colour) -> None:
    printed = printed_colour(colour)
    assert np.dot(printed, (0.2126, 0.7152, 0.0722)) <= BRIGHTEST + 1e-9
    assert np.argmax(printed) == np.argmax(colour)
