"""Slow, obvious twins of the kernels between the track and the spin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def naive_logo_rows(
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    mask_px: float,
    rim_px: float,
    ring_px: tuple[float, float],
) -> tuple[list[int], list[bool], int, int]:
    rows, inside, likes, others = [], [], 0, 0
    for i in range(len(t_us)):
        dt_s = (float(t_us[i]) - reference_us) * 1e-6
        dx = float(x_px[i]) - (centre_px[0] + velocity_px_s[0] * dt_s)
        dy = float(y_px[i]) - (centre_px[1] + velocity_px_s[1] * dt_s)
        ahead = dx * velocity_px_s[0] + dy * velocity_px_s[1] > 0
        as_a_bright_outline = ahead == bool(on[i])
        distance = math.sqrt(dx**2 + dy**2)
        if ring_px[0] < distance < ring_px[1]:
            likes, others = likes + as_a_bright_outline, others + (not as_a_bright_outline)
        moves = velocity_px_s != (0.0, 0.0)
        if distance < mask_px or (distance < rim_px and not (moves and as_a_bright_outline)):
            rows.append(i)
            inside.append(distance < mask_px)
    return rows, inside, likes, others


def naive_neighbours(
    t_us: NDArray[np.int64],
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    near_px: float,
    reach_px: float,
    reach_us: float,
    speed_max_px_s: float,
    most: int,
) -> list[list[int]]:
    """All earlier neighbours of every event, latest first, then cut to the first `most`."""
    result = []
    for k in range(len(t_us)):
        rows = []
        for j in range(k):
            dt_us = t_us[k] - t_us[j]
            distance2 = (x_px[k] - x_px[j]) ** 2 + (y_px[k] - y_px[j]) ** 2
            if (
                on[j] == on[k]
                and 0 < dt_us <= reach_us
                and near_px**2 <= distance2 <= reach_px**2
                and distance2 <= (speed_max_px_s * 1e-6 * dt_us) ** 2
            ):
                rows.append(j)
        result.append(rows[::-1][:most])
    return result


def naive_triplets(
    t_us: NDArray[np.int64],
    x_px: Floats,
    y_px: Floats,
    neighbours: list[list[int]],
    mismatch_px: float,
    mismatch_share: float,
) -> list[tuple[float, float, int]]:
    """(vx, vy, number of triplets) of every event, in px/s; NaN where there is none."""
    place = np.stack([x_px, y_px], axis=1)
    result = []
    for k in range(len(t_us)):
        votes, weights = [], []
        for j in neighbours[k]:
            for i in neighbours[j]:
                later, earlier = place[k] - place[j], place[j] - place[i]
                later_us, earlier_us = float(t_us[k] - t_us[j]), float(t_us[j] - t_us[i])
                off2_space = np.sum((later - earlier) ** 2) / mismatch_px**2
                off_time = (later_us - earlier_us) / (mismatch_share * (later_us + earlier_us) / 2)
                if off2_space <= 4 and off_time**2 <= 4:
                    votes.append((place[k] - place[i]) / (later_us + earlier_us) * 1e6)
                    weights.append(np.exp(-(off2_space + off_time**2) / 2))
        if votes:
            vx, vy = np.average(votes, axis=0, weights=weights)
            result.append((float(vx), float(vy), len(votes)))
        else:
            result.append((np.nan, np.nan, 0))
    return result


def naive_plane(
    x_px: Floats, y_px: Floats, t_us: Floats, scales_us: Floats, fewest: int, spread_px: float
) -> tuple[float, float, float] | None:
    """(a, b, rms) of the robust plane t = a x + b y + c; None where there is none."""
    design = np.stack([x_px, y_px, np.ones_like(x_px)], axis=1)
    weights = np.ones(len(t_us))
    answer, rms = np.zeros(3), 0.0
    for stage in range(len(scales_us) + 1):
        if stage:
            off = (t_us - design @ answer) / scales_us[stage - 1]
            weights = np.where(np.abs(off) < 1, (1 - off**2) ** 2, 0.0)
        if np.count_nonzero(weights) < fewest:
            return None
        spread = np.cov(x_px, y_px, aweights=weights, ddof=0)
        if np.linalg.eigvalsh(spread)[0] < spread_px**2:
            return None
        root = np.sqrt(weights)
        answer = np.linalg.lstsq(design * root[:, None], t_us * root, rcond=None)[0]
        rms = float(np.sqrt(np.average((t_us - design @ answer) ** 2, weights=weights)))
    return float(answer[0]), float(answer[1]), rms


def naive_line(u: Floats, v: Floats, t_s: Floats, width: float, rounds: int) -> tuple[Floats, float, float]:
    """(normal (2,), drift, sharpness) of a moving line by matrix algebra, see `fit_moving_line`."""
    points = np.stack([u, v], axis=1)
    weights = np.ones(len(t_s))
    normal, drift, constant, sharpness = np.zeros(2), 0.0, 0.0, 2.0
    for number in range(rounds):
        if number:
            off = (points @ normal - drift * t_s - constant) / width
            weights = np.where(np.abs(off) < 1, (1 - off**2) ** 2, 0.0)
        design = np.stack([t_s, np.ones_like(t_s)], axis=1)
        root = np.sqrt(weights)[:, None]
        fit = np.linalg.lstsq(design * root, points * root, rcond=None)[0]
        left = (points - design @ fit) * root
        values, vectors = np.linalg.eigh(left.T @ left)
        normal = vectors[:, 0]
        drift, constant = fit @ normal
        sharpness = float(values[0] / values[1])
    return normal, float(drift), sharpness


def naive_low_pass(signal: Floats, cutoff_cycles: float) -> Floats:
    """Butterworth of second order, both ways, by scipy."""
    from scipy.signal import butter, filtfilt

    b, a = butter(2, 2 * cutoff_cycles)
    result: Floats = filtfilt(b, a, signal, padtype=None)
    return result


def naive_autocorrelation(signal: Floats, lag: int) -> float:
    early, late = signal[: len(signal) - lag], signal[lag:]
    norm = np.sqrt(np.sum(early**2) * np.sum(late**2))
    return float(np.sum(early * late) / norm) if norm > 0 else 0.0


def naive_correlated_covariance(
    gain: Floats, residuals: Floats, radians: Floats, place: Floats, bias: Floats, place_std_px: Floats
) -> Floats:
    """Each block of one radian, each part of the place and each bias as one independent error."""
    blocks = sorted(set(np.floor(radians).tolist()))
    errors = [gain[np.floor(radians) == block].T @ residuals[np.floor(radians) == block] for block in blocks]
    covariance = sum(np.outer(error, error) for error in errors) * len(blocks) / max(len(blocks) - 1, 1)
    for k in range(3):
        moved, bent = gain.T @ place[:, k] * place_std_px[k], gain.T @ bias[:, k]
        covariance = covariance + np.outer(moved, moved) + np.outer(bent, bent)
    return np.asarray(covariance)
