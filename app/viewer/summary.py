"""Text of a run: a summary in Markdown that follows the playhead, and a card of big numbers for the coach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.shots import BEGAN_WORDS, ENDED_WORDS
from spinscope.pipeline.spin_terms import Kind, axis_words, kind_of_spin, km_h, rpm, speed_words, std_words
from spinscope.pipeline.tick import Tick

from . import entities as at
from .png import png
from .rerun_api import Chunk, columns_at, once, styled
from .run import ViewedRun, sentence, shown_estimate

Vector = NDArray[np.float64]
Block = tuple[str, str]  # a line in big letters, one in small ones
Card = tuple[Block, Block, Block]

CARD_PX, BLOCK_PX = 640, 213
BIG_PX, SMALL_PX = 108, 32
TEXT, FAINT = 240, 150  # grey values
# The Kalman filter's velocity needs a moment to settle: no direction of flight is named below this speed.
MIN_SPEED_M_S = 0.2


def summary_chunks(run: ViewedRun) -> list[Chunk]:
    """Summary and card at the start and at the end of every tick."""
    texts, cards = [_opening(run)], [_first_card(run)]
    result: list[str] = []
    for row, (tick, true_rps) in enumerate(zip(run.ticks, _true_spins(run), strict=True)):
        velocity = _velocity_m_s(run, tick)
        shot = run.final_shots.get(row)
        if shot is not None and not run.fixed and shot.t_us.size > 1:
            velocity = shot.velocity_m_s(run.camera, run.ball_radius_m)
        state = _TickState(run, tick, velocity, true_rps)
        if shot is not None:
            milliseconds = (shot.end_us - shot.start_us) / 1000
            result = state.lines(f"shot {run.shot_numbers[shot.number]} of {len(run.shots)}, {milliseconds:.0f} ms")
        if not tick.track.has_ball:
            text = _without_ball(run, tick, result)
        else:
            text = result if shot is not None else state.lines("so far")
        texts.append("\n".join(text))
        cards.append(state.card("so far" if shot is None else "whole shot") if tick.track.has_ball else cards[-1])
    return [
        columns_at(at.SUMMARY, run.times_us, rr.TextDocument.columns(text=texts)),
        styled(at.SUMMARY, rr.TextDocument, media_type="text/markdown"),
        *_card_chunks(run, cards),
    ]


@dataclass(frozen=True)
class _TickState:
    """State of the run at the end of a tick.

    Attributes
    ----------
    velocity_m_s : (3,) float64, optional
        Camera frame; None for a ball in place.
    true_rps : (3,) float64, optional
        True spin; None where there is none.
    """

    run: ViewedRun
    tick: Tick
    velocity_m_s: Vector | None
    true_rps: Vector | None

    @cached_property
    def answer(self) -> tuple[SpinEstimate, Kind, bool] | None:
        """Estimate shown, its kind of spin, and whether it is trusted; None where no method answers."""
        estimate, trusted = shown_estimate(self.tick)
        if estimate is None or estimate.vector_rps is None:
            return None
        return estimate, kind_of_spin(estimate.vector_rps, self.velocity_m_s, self.run.camera.up), trusted

    def lines(self, span: str) -> list[str]:
        """The whole summary of a span of time."""
        return [*self._headline(span), *self._table(), *_shot_table(self.run), *_evidence(self.run, self.tick)]

    def _headline(self, span: str) -> list[str]:
        """Heading with the answer, or that there is none yet."""
        speed = speed_words(self.velocity_m_s)
        if self.answer is None:
            return ["## Spin not known", "", f"{sentence(speed)}; {span}.", ""]
        estimate, kind, trusted = self.answer
        magnitude_rps = estimate.magnitude_rps or 0.0
        doubt = "" if trusted else " (no method is trusted)"
        return [
            f"## {magnitude_rps:.1f} rps · {kind.name}{doubt}",
            "",
            f"{sentence(kind.sentence)}. **{rpm(magnitude_rps):.0f} rpm**, {speed}; {span}.",
            "",
        ]

    def _table(self) -> list[str]:
        """Table of every method's answer, and of the truth where there is one; below it why the others refuse.

        A reason in the table would push the axes out of sight.
        """
        lines = ["| method | spin [rps] | axis (x, y, z) |", "|---|---|---|"]
        for method in self.run.methods:
            estimate = self.tick.estimates[method.name]
            name = f"**{method.label} ✔**" if self.tick.best == method.name else method.label
            lines.append(f"| {name} | {_magnitude(estimate)} | {axis_words(estimate)} |")
        reason, combined = self.tick.balls[0].best_reason, self.tick.get("combined")
        notes = []
        for method in self.run.methods:
            if (refusal := self.tick.estimates[method.name].reason) is not None:
                notes += [f"{method.label} refused: {refusal}.", ""]
        notes += [] if combined is None or not combined.summary else [f"Combined: {combined.summary}.", ""]
        notes += [] if reason is None else [f"No spin is trusted: {reason}.", ""]
        return [*lines, *self._truth_rows(), "", *notes]

    def _truth_rows(self) -> list[str]:
        """Last row of the table with the truth, and below it the errors of every answer."""
        if self.true_rps is None:
            return []
        truth = SpinEstimate("truth", self.true_rps, None, None)
        lines = [f"| truth | {_magnitude(truth)} | {axis_words(truth)} |", ""]
        for method in self.run.methods:
            estimate = self.tick.estimates[method.name]
            if estimate.axis is not None and truth.axis is not None:
                angle = math.degrees(math.acos(min(max(float(estimate.axis @ truth.axis), -1.0), 1.0)))
                off = abs((estimate.magnitude_rps or 0) - (truth.magnitude_rps or 0))
                lines += [f"{method.label}: magnitude {off:.1f} rps and axis {angle:.1f}° from the truth.", ""]
        return lines

    def card(self, span: str) -> Card:
        """Spin with the span of time that it is of, speed and kind, each in big letters with a line in small ones."""
        velocity = self.velocity_m_s
        speed = None if velocity is None else float(np.linalg.norm(velocity))
        big = "In place" if self.run.fixed else "-" if speed is None else f"{km_h(speed):.0f} km/h"
        speed_lines = big, "" if speed is None else f"{speed:.1f} m/s"
        if self.answer is None:
            return ("-", ""), speed_lines, ("Spin not known", "no method has an answer")
        estimate, kind, is_trusted = self.answer
        if not is_trusted:
            doubted = f"{estimate.magnitude_rps:.0f} rps, {kind.name}: not trusted"
            return ("-", doubted), speed_lines, ("Spin not known", self.tick.balls[0].best_reason or "not trusted")
        magnitude, std = estimate.magnitude_rps or 0.0, estimate.magnitude_std_rps
        margin = "" if std is None else f" ± {rpm(std):.0f}"
        more = kind.sentence.removeprefix(kind.name).strip(" ,")
        return (
            (f"{magnitude:.0f} rps", f"{rpm(magnitude):.0f}{margin} rpm, {span}"),
            speed_lines,
            (kind.name.capitalize(), more.strip("()") if more.startswith("(") else more),
        )


def _shot_table(run: ViewedRun) -> list[str]:
    """Every shot of the run with its trusted spin, a row each: before and after a contact side by side."""
    if len(run.shots) < 2:
        return []
    lines = ["| shot | ms | began | spin [rps] | axis (x, y, z) | ended |", "|---|---|---|---|---|---|"]
    notes = []
    for number, shot in enumerate(run.shots, 1):
        span = f"{shot.start_us / 1000:.0f} to {shot.end_us / 1000:.0f}"
        spin, axis = "not known", "-"
        if shot.best is None:
            notes += [f"Shot {number}: no spin is trusted: {shot.best_reason}.", ""]
        else:
            spin, axis = _magnitude(shot.estimates[shot.best]), axis_words(shot.estimates[shot.best])
        began, ended = BEGAN_WORDS[shot.began_by], ENDED_WORDS[shot.ended_by]
        lines.append(f"| {number} | {span} | {began} | {spin} | {axis} | {ended} |")
    return [*lines, "", *notes]


def _true_spins(run: ViewedRun) -> list[Vector | None]:
    """True spin at every tick; None where the ball does not spin or is not there."""
    if run.true_spins_rps is None:
        return [None] * len(run.ticks)
    return [spin if np.isfinite(spin).all() and spin.any() else None for spin in run.true_spins_rps]


def _velocity_m_s(run: ViewedRun, tick: Tick) -> Vector | None:
    """Velocity of the ball across the line of sight at the end of the tick; None for a ball in place or without one.

    The component along the line of sight needs the whole shot: in one tick the radius does not tell it.
    """
    if run.fixed or not tick.track.has_ball:
        return None
    step_s = 1e-3
    ahead = tick.track.mean.copy()
    ahead[:2] += tick.track.mean[2:4] * step_s
    here, there = run.centre_m(np.stack([tick.track.mean, ahead]))
    velocity: Vector = (there - here) / step_s
    return velocity if np.linalg.norm(velocity) >= MIN_SPEED_M_S else None


def _first_card(run: ViewedRun) -> Card:
    """Card before anything is known."""
    headline = "No ball yet" if run.no_shot_reason is None else "No shot"
    return ("-", "spin"), ("-", "speed"), (headline, run.no_shot_reason or "")


def _opening(run: ViewedRun) -> str:
    """Text before anything is known."""
    lines = ["## No ball yet", ""]
    if run.no_shot_reason:
        lines = ["## No shot in this recording", "", f"**{sentence(run.no_shot_reason)}**", ""]
    return "\n".join([*lines, *_origin(run)])


def _origin(run: ViewedRun) -> list[str]:
    """Recording and span of the run, and its warnings."""
    span = f"{run.start_us:,} to {run.end_us:,} us"
    return [
        f"`{run.name}`, {span}; the timeline is the file's own time.",
        "",
        *(f"Warning: {warning}\n" for warning in run.warnings),
    ]


def _without_ball(run: ViewedRun, tick: Tick, result: list[str]) -> list[str]:
    """Lines of the last shot's result while no ball is there, or that there was none yet."""
    if result:
        return [*result, "", "---", f"Now {tick.track.reason}"]
    return [_opening(run), "", f"Tracker {tick.track.status}; {tick.track.reason}"]


def _magnitude(estimate: SpinEstimate) -> str:
    magnitude, std = estimate.magnitude_rps, estimate.magnitude_std_rps
    if magnitude is None:
        return "refused"
    return f"{magnitude:.1f}" if std is None else f"{magnitude:.1f} ± {std_words(std)}"


def _evidence(run: ViewedRun, tick: Tick) -> list[str]:
    """Results of the stages behind the answer, of those that were run."""
    mean, deviation = tick.track.mean, np.sqrt(np.diag(tick.track.covariance))
    lines = [
        f"Tracker: {tick.track.status}; centre ({mean[0]:.1f}, {mean[1]:.1f}) ± {deviation[:2].max():.1f} px, "
        f"radius {mean[4]:.1f} ± {deviation[4]:.1f} px."
    ]
    if (logo := tick.get("logo")) is not None:
        lines.append(f"{len(logo.events)} logo events in this tick.")
    if (rate := tick.get("rate")) is not None:
        std = f" ± {rate.spin_std_rps:.1f}" if rate.spin_std_rps is not None else ""
        found = f"none: {rate.reason}" if rate.spin_rps is None else f"{rate.spin_rps:.1f}{std} rps"
        lines.append(f"Spin from the event rate's zero crossings: {found}.")
    if (flow := tick.get("flow")) is not None and flow.t_acc_us is not None:
        lines.append(f"Flow from slices of {flow.t_acc_us} us.")
    lines += _contrast_lines(tick)
    return [*(part for line in lines for part in (line, "")), *_origin(run)]


def _contrast_lines(tick: Tick) -> list[str]:
    """Sharpness of the derotated logo, over which time, and the nearest rival."""
    result = tick.get("contrast")
    if result is None or not np.isfinite(result.best_rps).all():
        return []
    stretch = f"from {result.start_us / 1000:.1f} to {result.end_us / 1000:.1f} ms"
    rivals = "no other spin comes near"
    if count := result.rival_sigmas.size:
        others = "1 other spin comes" if count == 1 else f"{count} other spins come"
        rivals = f"{others} near, {result.rival_sigmas.min():.1f} σ below"
    return [f"Contrast of the derotated logo {result.contrast:.2f} (0 = random), events {stretch}; {rivals}."]


def _card_chunks(run: ViewedRun, cards: list[Card]) -> list[Chunk]:
    """Blocks of the card, one below the other, each at the times at which its text changes."""
    chunks = []
    for number, column in enumerate(zip(*cards, strict=True)):
        entity = f"{at.COACH}/{number}"
        changes = [row for row in range(len(column)) if row == 0 or column[row] != column[row - 1]]
        pictures = [_block(*column[row]) for row in changes]
        place = rr.Transform3D(translation=[0.0, number * BLOCK_PX, 0.0])
        chunks += [
            columns_at(entity, run.times_us[changes], rr.EncodedImage.columns(blob=pictures)),
            once(entity, place, rr.EncodedImage.from_fields(media_type="image/png")),
        ]
    return chunks


@lru_cache(maxsize=512)
def _block(big: str, small: str) -> bytes:
    """PNG of a line in big letters and one in small ones."""
    picture = Image.new("L", (CARD_PX, BLOCK_PX), at.BACKGROUND[0])
    draw = ImageDraw.Draw(picture)
    left, top = 36, 30
    size = _fitting(draw, big, BIG_PX)
    draw.text((left, top), big, TEXT, font=_font(size))
    font = _font(_fitting(draw, small, SMALL_PX))
    draw.text((left + 4, top + 1.2 * size), small, FAINT, font=font)
    return png(np.asarray(picture))


@lru_cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font: the same letters on every machine."""
    return ImageFont.load_default(size)


def _fitting(draw: ImageDraw.ImageDraw, text: str, size: int) -> int:
    """Size in which the text fits on the card, this one at most."""
    width = draw.textlength(text, font=_font(size))
    return min(size, int(size * (CARD_PX - 60) / max(width, 1)))
