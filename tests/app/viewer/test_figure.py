"""Figure of the series for a publication."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.figure import BRIGHTEST, TIME_LABELS, printed_colour, series_figure, time_range_ms
from spinscope.app.viewer.run import ViewedRun


def test_svg_and_pdf_hold_every_curve(flight: ViewedRun) -> None:
    text = series_figure(flight, ".svg", pinned=flight).decode()
    ElementTree.fromstring(text)
    for words in ("x [px]", "Spin [rps]", "Axis error", "Contrast maximisation", "A: Contrast maximisation", "truth"):
        assert f"<!-- {words}" in text, words
    assert "A: truth" not in text
    assert series_figure(flight, ".pdf").startswith(b"%PDF")


def test_all_panels_show_the_time_of_the_ball(flight: ViewedRun) -> None:
    """Spins begin later than the track: one above the other they stand at the same times all the same."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    figure = ElementTree.fromstring(series_figure(flight, ".svg"), parser)
    ends_ms = flight.ends_us[flight.has_ball] / 1000
    shown = set()
    for panel in figure.iterfind(".//*[@id='matplotlib.axis_1']"):
        labels = [str(one.text).strip() for one in panel.iter() if callable(one.tag)]  # a comment's: its function
        shown.add(tuple(float(label) for label in labels if label != "time [ms]"))
    (times_ms,) = shown
    assert 2 < len(times_ms) <= TIME_LABELS + 1
    assert time_range_ms(flight)[0] <= times_ms[0] and times_ms[-1] <= time_range_ms(flight)[1]
    assert time_range_ms(flight)[0] < ends_ms[0] and ends_ms[-1] < time_range_ms(flight)[1]


@pytest.mark.parametrize("colour", [entities.HOUGH_COLOUR, entities.RATE_COLOUR, entities.TRUTH_COLOUR])
def test_colours_are_seen_on_white(colour: entities.Colour) -> None:
    printed = printed_colour(colour)
    assert np.dot(printed, (0.2126, 0.7152, 0.0722)) <= BRIGHTEST + 1e-9
    assert np.argmax(printed) == np.argmax(colour)
