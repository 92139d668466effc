"""Report of a session to take home: one HTML file that needs nothing else, or the same as PDF."""

from __future__ import annotations

import base64
import importlib
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from html import escape
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.files import atomic_file

from .session import Row, ShotSession
from .shot_words import ShotWords, kind_codes
from .statistics import SeriesStatistics, compared, series_statistics

COLOURS = ("#0072b2", "#c24e00", "#007a5a", "#a3427d", "#6b5900", "#2c7da0", "#555555")  # as in static/coach/charts.js
MARKERS = "os^D"
STYLE = """
body { font: 15px/1.45 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; color: #15191e; margin: 24px auto;
  max-width: 900px; padding: 0 16px; }
h1 { font-size: 24px; margin: 0; } h2 { font-size: 18px; margin: 24px 0 8px; }
p.note, small { color: #525b66; } ul { margin: 8px 0; font-size: 17px; }
table { border-collapse: collapse; width: 100%; } th, td { text-align: left; padding: 4px 8px;
  border-bottom: 1px solid #d5d9df; } thead th { border-bottom: 2px solid #6b7480; }
tr, figure { break-inside: avoid; } figure { margin: 0; } svg, img.chart { width: 100%; height: auto; }
td:nth-child(n + 5) { white-space: nowrap; } td img { display: block; width: 44px; height: 44px; border-radius: 6px; }
@page { size: A4; margin: 14mm; } @media print { body { margin: 0; max-width: none; font-size: 11px; } }
"""


def write_report(session: ShotSession, path: Path, words: ShotWords) -> None:
    """Write the report as .html or .pdf; raises SpinscopeError.

    PDF needs WeasyPrint, which is an extra.
    """
    suffix = path.suffix.lower()
    if suffix not in (".html", ".htm", ".pdf"):
        raise ParameterError(f"a report ends in .html or .pdf: give such a name instead of {path}")
    page = report_html(session, words)
    with atomic_file(path, "report") as part:
        if suffix == ".pdf":
            part.write_bytes(_pdf(page))
        else:
            part.write_text(page, encoding="utf-8")


def report_html(session: ShotSession, words: ShotWords) -> str:
    """The whole report as one HTML text: answers, players by kind, spread, tests, every shot."""
    shots = [shot for shot in session.shots() if not shot["deleted"]]
    t = words.text
    parts = [f"<h1>{escape(t('report'))}: {escape(session.name)}</h1>", f"<p class=note>{_span(shots)}</p>"]
    usual = _usual_kind(shots)
    if usual is not None:
        of_kind = [shot for shot in shots if list(kind_codes(shot))[:1] == [usual]]
        players = _statistics(of_kind, lambda shot: words.name(shot["player"]))
        parts.append(_list(answers(players, t(usual), words)))
        parts += [f"<h2>{escape(t('spread'))} ({escape(t(usual))})</h2>", _chart(of_kind, players, words)]
    groups = _statistics(shots, lambda shot: f"{words.name(shot['player'])}, {t((*kind_codes(shot), 'not_seen')[0])}")
    parts += [f"<h2>{escape(t('compare'))}</h2>", _statistics_table(groups, words)]
    drilled = sorted((shot for shot in shots if shot["drill"]), key=lambda shot: (shot["drill"], shot["player"] or ""))
    tests = _statistics(
        drilled, lambda shot: f"{words.name(shot['drill'])}, {words.name(shot['player'])}, {_day(shot)}"
    )
    if tests:
        parts += [f"<h2>{escape(t('tests'))}</h2>", _statistics_table(tests, words)]
    parts += [f"<h2>{escape(t('shots'))}</h2>", _shot_table(session, shots, words)]
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="{words.language}"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(session.name)}</title>'
        f"<style>{STYLE}</style></head><body>\n{body}\n<p class=note>{escape(t('made_by'))}</p></body></html>\n"
    )


def answers(players: Mapping[str, SeriesStatistics], kind: str, words: ShotWords) -> list[str]:
    """Answer in sentences: the player with the most spin of a kind, and whether each got better."""
    names, is_clear = compared(players)
    found = []
    if len(names) > 1:
        value, other_value = (words.spin(players[name].median_rps) for name in names[:2])
        told = {"group": names[0], "other": names[1], "kind": kind, "value": value, "other_value": other_value}
        found.append(words.text("answer_more" if is_clear else "answer_even", **told))
    for name, one in players.items():
        change = None if one.change_rps is None else abs(one.change_rps)
        found.append(words.text(one.trend, group=name, value=words.spin(change), since=words.text("halves")))
    return found


def _statistics(shots: Sequence[Row], group: Callable[[Row], str]) -> dict[str, SeriesStatistics]:
    names = dict.fromkeys(group(shot) for shot in shots)
    return {name: series_statistics([shot for shot in shots if group(shot) == name]) for name in names}


def _usual_kind(shots: Iterable[Row]) -> str | None:
    """The main kind of most shots."""
    kinds = [codes[0] for shot in shots if (codes := kind_codes(shot))]
    return max(dict.fromkeys(kinds), key=kinds.count, default=None)


def _statistics_table(groups: Mapping[str, SeriesStatistics], words: ShotWords) -> str:
    heads = ["", *(words.text(key) for key in ("count", "unseen", "median", "deviation", "best", "speed"))]
    rows = [
        [
            name,
            str(one.count),
            str(one.unseen),
            *map(words.spin, (one.median_rps, one.spread_rps, one.best_rps)),
            words.speed(one.median_speed_m_s),
        ]
        for name, one in groups.items()
    ]
    return _table(heads, [[escape(cell) for cell in row] for row in rows])


def _shot_table(session: ShotSession, shots: Sequence[Row], words: ShotWords) -> str:
    heads = ["", *(words.text(key) for key in ("time", "player", "kind", "spin", "speed", "drill"))]
    rows = []
    for shot in shots:
        when = datetime.fromtimestamp(shot["recorded_s"]).strftime("%Y-%m-%d %H:%M")
        about = ", ".join(words.name(shot[name]) for name in ("wing", "stroke") if shot[name])
        cells = [when, words.name(shot["player"]), words.kind(shot), words.spin(shot["spin_rps"])]
        cells += [words.speed(shot["speed_m_s"]), words.name(shot["drill"]) if shot["drill"] else ""]
        cells = [escape(cell) for cell in cells]
        cells[1] += f"<br><small>{escape(about)}</small>" if about else ""
        rows.append([_picture(session, shot), *cells])
    return _table([escape(head) for head in heads], rows)


def _picture(session: ShotSession, shot: Row) -> str:
    path = session.folder / str(shot["picture_file"])
    if shot["picture_file"] is None or not path.is_file():
        return ""
    return f'<img alt="" src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}">'


def _chart(shots: Sequence[Row], players: Mapping[str, SeriesStatistics], words: ShotWords) -> str:
    """Spin against speed with the ellipses of the spread, as SVG in the page."""
    per_rps, per_m_s = (60 if words.spin_unit == "rpm" else 1), (3.6 if words.speed_unit == "km_h" else 1)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "spinscope", "font.size": 11}):
        figure = Figure(figsize=(8, 3.8), layout="constrained")
        axes = figure.add_subplot()
        for number, (name, one) in enumerate(players.items()):
            colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
            own = [shot for shot in shots if words.name(shot["player"]) == name and shot["speed_m_s"]]
            places = [[shot["speed_m_s"] * per_m_s for shot in own], [shot["spin_rps"] * per_rps for shot in own]]
            axes.plot(*places, marker, color=colour, label=name)
            if one.ellipse:
                outline = [*zip(*one.ellipse, strict=True)]
                edge = [[speed * per_m_s for speed in outline[0]], [spin * per_rps for spin in outline[1]]]
                axes.fill(*edge, facecolor=colour, alpha=0.12, edgecolor=colour)
        axes.set_xlabel(f"{words.text('speed')} ({words.text(words.speed_unit)})")
        axes.set_ylabel(f"{words.text('spin')} ({words.text(words.spin_unit)})")
        axes.set_ylim(bottom=0)
        axes.legend(frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    svg = drawn.getvalue()
    return f"<figure>{svg[svg.index('<svg') :]}<figcaption>{escape(words.text('spread_help'))}</figcaption></figure>"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{cell}</th>" for cell in heads)
    body = "\n".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"


def _list(sentences: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>"


def _day(shot: Row) -> str:
    return datetime.fromtimestamp(shot["recorded_s"]).strftime("%Y-%m-%d")


def _span(shots: Sequence[Row]) -> str:
    """First and last day."""
    return " – ".join(dict.fromkeys(_day(shot) for shot in (*shots[:1], *shots[-1:])))


def _pdf(page: str) -> bytes:
    try:
        weasyprint: Any = importlib.import_module("weasyprint")
    except ImportError:
        raise ParameterError(
            "a PDF needs WeasyPrint: install it with `pip install spinscope[report]`, or print the HTML report"
        ) from None
    except OSError as error:  # its C library
        raise ParameterError(
            f"a PDF needs the library Pango ({error}): install it with the system's packages, or print the HTML report"
        ) from None
    written: bytes = weasyprint.HTML(string=page).write_pdf()
    return written
