"""The run in words: Markdown that follows the playhead, and a card of big numbers for the coach."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pipeline.chain import Tick
from pipeline.results import SpinEstimate
from pipeline.shots import Shot

from ..words import axis_words, kind_of_spin, km_h, rpm, speed_words, std_words
from . import entities as at
from .rerun_api import Chunk, columns_at, once
from .run import Run, shown_estimate

Vector = NDArray[np.float64]

CARD_PX = 640
BIG_PX, SMALL_PX = 108, 32
TEXT, FAINT = 240, 150  # grey values
# Kalman velocity needs a moment to settle; a flight's direction is told from this speed on.
SLOWEST_M_S = 0.2


def summary_chunks(run: Run) -> list[Chunk]:
    """The summary and the card at the start and at the end of every tick."""
    texts, cards = [_opening(run)], [_card(("-", "-", "No ball yet"), ("spin", "speed", run.no_shot_reason or ""))]
    finals = {shot.end_us: shot for shot in run.shots}
    result: list[str] = []
    card = cards[0]
    for tick in run.ticks:
        velocity = _velocity_m_s(run, tick)
        shot = finals.get(tick.packet.end_us)
        if shot is not None:
            if not run.fixed and shot.t_us.size > 1:
                velocity = shot.velocity_m_s(run.camera, run.ball_radius_m)
            result = _shot_result(run, tick, shot, velocity)
        if tick.track.has_ball:
            card = _tick_card(run, tick, velocity)
        texts.append("\n".join(_tick_text(run, tick, velocity, result)))
        cards.append(card)
    return [
        columns_at(at.SUMMARY, run.times_us, rr.TextDocument.columns(text=texts)),
        once(at.SUMMARY, rr.TextDocument.from_fields(media_type="text/markdown")),
        columns_at(at.COACH, run.times_us, rr.EncodedImage.columns(blob=cards)),
        once(at.COACH, rr.EncodedImage.from_fields(media_type="image/png")),
    ]


def _velocity_m_s(run: Run, tick: Tick) -> Vector | None:
    """The ball's velocity across the line of sight at the end of the tick; None for a ball in place or without one.

    The way towards the camera is left to the whole shot: in one tick the radius does not tell it.
    """
    if run.fixed or not tick.track.has_ball:
        return None
    step_s = 1e-3
    ahead = tick.track.mean.copy()
    ahead[:2] += tick.track.mean[2:4] * step_s
    here, there = run.centre_m(np.stack([tick.track.mean, ahead]))
    velocity: Vector = (there - here) / step_s
    return velocity if np.linalg.norm(velocity) >= SLOWEST_M_S else None


def _opening(run: Run) -> str:
    """What is said before anything is known."""
    lines = ["## No ball yet", ""]
    if run.no_shot_reason:
        reason = run.no_shot_reason.removeprefix("no ball: ")
        lines = ["## No ball in this recording", "", f"Because: **{reason}**", ""]
    return "\n".join([*lines, *_origin(run)])


def _origin(run: Run) -> list[str]:
    """What the run is of, and what people should know about it."""
    span = f"{run.start_us:,} to {run.end_us:,} us"
    return [
        f"`{run.name}`, {span}; the timeline is the file's own time.",
        "",
        *(f"Warning: {warning}\n" for warning in run.warnings),
    ]


def _tick_text(run: Run, tick: Tick, velocity: Vector | None, result: list[str]) -> list[str]:
    if not tick.track.has_ball:
        if result:
            return [*result, "", "---", f"Now: {tick.track.reason or 'no ball'}"]
        return [_opening(run), "", f"Tracker: {tick.track.status}, {tick.track.reason or 'no ball'}"]
    if result and run.shots and any(shot.end_us == tick.packet.end_us for shot in run.shots):
        return result
    return [*_headline(run, tick, velocity, "so far"), *_table(run, tick), *_evidence(run, tick)]


def _shot_result(run: Run, tick: Tick, shot: Shot, velocity: Vector | None) -> list[str]:
    """What the whole shot says."""
    milliseconds = (shot.end_us - shot.start_us) / 1000
    said = f"shot {shot.number + 1} of {len(run.shots)}, {milliseconds:.0f} ms"
    return [*_headline(run, tick, velocity, said), *_table(run, tick), *_evidence(run, tick)]


def _headline(run: Run, tick: Tick, velocity: Vector | None, said: str) -> list[str]:
    """The answer in a heading, or that there is none yet and why."""
    estimate, trusted = shown_estimate(tick)
    lines = []
    if estimate is not None and estimate.vector_rps is not None:
        kind = kind_of_spin(estimate.vector_rps, velocity, run.camera.up)
        doubt = "" if trusted else " (no method is trusted)"
        lines += [f"## {estimate.magnitude_rps:.1f} rps · {kind.name}{doubt}", ""]
        turns = f"**{rpm(estimate.magnitude_rps or 0):.0f} rpm**"
        lines += [f"{_sentence(kind.sentence)}. {turns}, {speed_words(velocity)}; {said}.", ""]
    else:
        lines += ["## Spin not known", "", f"{_sentence(speed_words(velocity))}; {said}.", ""]
    return lines


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _table(run: Run, tick: Tick) -> list[str]:
    """Every method's answer or refusal, and the truth where there is one."""
    lines = ["| method | spin [rps] | axis (x, y, z) |", "|---|---|---|"]
    for method, estimate in tick.estimates.items():
        name = f"**{method} ✔**" if tick.best == method else method
        lines.append(f"| {name} | {_magnitude(estimate)} | {axis_words(estimate)} |")
    return [*lines, *_truth_rows(run, tick), ""]


def _truth_rows(run: Run, tick: Tick) -> list[str]:
    """The truth as the table's last row, and how far from it every answer is."""
    if run.truth is None:
        return []
    spin = run.true_values(np.array([tick.track.t_us]), run.truth.spin_rps)[0]
    if not (np.isfinite(spin).all() and spin.any()):
        return []
    truth = SpinEstimate("truth", spin, None, None)
    lines = [f"| truth | {_magnitude(truth)} | {axis_words(truth)} |", ""]
    for method, estimate in tick.estimates.items():
        if estimate.axis is not None:
            angle = np.degrees(np.arccos(np.clip(estimate.axis @ spin / np.linalg.norm(spin), -1, 1)))
            off = abs((estimate.magnitude_rps or 0) - (truth.magnitude_rps or 0))
            lines += [f"{method} is {off:.1f} rps and {angle:.1f}° from the truth.", ""]
    return lines


def _magnitude(estimate: SpinEstimate) -> str:
    magnitude, std = estimate.magnitude_rps, estimate.magnitude_std_rps
    if magnitude is None:
        return f"refused: {estimate.reason}"
    return f"{magnitude:.1f}" if std is None else f"{magnitude:.1f} ± {std_words(std)}"


def _evidence(run: Run, tick: Tick) -> list[str]:
    """What the answer stands on: the tracker, the logo, the rhythm."""
    rate, flow = tick.rate, tick.flow
    if rate.spin_rps is None:
        rhythm = f"no rhythm in the event rate: {rate.reason}"
    else:
        rhythm = f"rhythm of the event rate {rate.spin_rps:.1f} ± {rate.spin_std_rps or 0:.1f} rps"
    slices = "" if flow.t_acc_us is None else f", flow in slices of {flow.t_acc_us} us"
    mean, deviation = tick.track.mean, np.sqrt(np.diag(tick.track.covariance))
    return [
        f"Tracker {tick.track.status}: centre ({mean[0]:.1f}, {mean[1]:.1f}) ± {deviation[:2].max():.1f} px, "
        f"radius {mean[4]:.1f} ± {deviation[4]:.1f} px; {len(tick.logo.events)} logo events in this tick.",
        "",
        f"{_sentence(rhythm)}{slices}.",
        "",
        *_contrast_words(tick),
        *_origin(run),
    ]


def _contrast_words(tick: Tick) -> list[str]:
    """How sharp the logo is, over which time, and how near the next best spin comes."""
    result = tick.contrast
    if result is None or not np.isfinite(result.best_rps).all():
        return []
    stretch = f"from {result.start_us / 1000:.1f} to {result.end_us / 1000:.1f} ms"
    rivals = "no rival"
    if result.rival_sigmas.size:
        count = result.rival_sigmas.size
        rivals = f"{count} rival{'s' if count > 1 else ''}, {result.rival_sigmas.min():.1f} σ behind"
    return [f"Contrast {result.contrast:.2f} an event over chance, {stretch}; {rivals}.", ""]


def _tick_card(run: Run, tick: Tick, velocity: Vector | None) -> bytes:
    """Spin, speed and kind, each in big letters with its small print."""
    estimate, trusted = shown_estimate(tick)
    speed = None if velocity is None else float(np.linalg.norm(velocity))
    speed_big = "In place" if run.fixed else "-" if speed is None else f"{km_h(speed):.0f} km/h"
    speed_small = "" if speed is None else f"{speed:.1f} m/s"
    if estimate is None or estimate.vector_rps is None or not trusted:
        return _card(("-", speed_big, "Spin not known"), ("", speed_small, "yet, or too little to trust"))
    kind = kind_of_spin(estimate.vector_rps, velocity, run.camera.up)
    magnitude, std = estimate.magnitude_rps or 0.0, estimate.magnitude_std_rps
    margin = "" if std is None else f" ± {rpm(std):.0f}"
    rest = kind.sentence.removeprefix(kind.name).strip(" ,")
    return _card(
        (f"{magnitude:.0f} rps", speed_big, kind.name.capitalize()),
        (f"{rpm(magnitude):.0f}{margin} rpm", speed_small, rest),
    )


@lru_cache(maxsize=256)
def _card(big: tuple[str, str, str], small: tuple[str, str, str]) -> bytes:
    """PNG of three blocks, each a line in big letters and one in small ones."""
    picture = Image.new("L", (CARD_PX, CARD_PX), at.BACKGROUND[0])
    draw = ImageDraw.Draw(picture)
    for block, (first, second) in enumerate(zip(big, small, strict=True)):
        left, top = 36, 30 + block * CARD_PX // 3
        size = _fitting(draw, first, BIG_PX)
        draw.text((left, top), first, TEXT, font=_font(size))
        font = _font(_fitting(draw, second, SMALL_PX))
        draw.text((left + 4, top + 1.2 * size), second, FAINT, font=font)
    return bytes(cv2.imencode(".png", np.asarray(picture))[1])  # five times as fast as Pillow's


@lru_cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font: the same letters on every machine."""
    return ImageFont.load_default(size)


def _fitting(draw: ImageDraw.ImageDraw, text: str, size: int) -> int:
    """The size in which the text fits on the card, this one at most."""
    width = draw.textlength(text, font=_font(size))
    return min(size, int(size * (CARD_PX - 60) / max(width, 1)))
