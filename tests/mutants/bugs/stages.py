"""Realistic bugs of stages and kernels."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

STAGES = [
    Mutant(
        "pipeline/stages/filter.py",
        "(MODES[parameters.logo_mode], parameters.logo_threshold_us)",
        "(MODES[parameters.logo_mode], parameters.threshold_us)",
        "tests/pipeline/stages/test_filter.py",
    ),
    Mutant(
        "pipeline/stages/surface.py",
        "state.update(packet, filtered.surface_events)",
        "state.update(packet, packet.events)",
        "tests/pipeline/stages/test_surface.py",
    ),
    Mutant(
        "pipeline/stages/surface.py",
        '"accumulated": partial(LastEventSurface, is_linear=False)',
        '"accumulated": partial(LastEventSurface, is_linear=True)',
        "tests/pipeline/stages/test_surface.py",
    ),
    Mutant(
        "pipeline/stages/logo.py",
        "pad_px = parameters.pad_px if moving else parameters.fixed_pad_px",
        "pad_px = parameters.pad_px",
        "tests/pipeline/stages/test_logo.py",
    ),
    Mutant(
        "pipeline/stages/logo.py",
        "events.t_us.astype(np.float64) - parameters.delay_us",
        "events.t_us.astype(np.float64) + parameters.delay_us",
        "tests/pipeline/stages/test_logo.py",
    ),
    Mutant(
        "pipeline/stages/logo.py",
        "velocity_std_px_s=math.sqrt(0.5 * (",
        "velocity_std_px_s=math.sqrt((",
        "tests/pipeline/stages/test_logo.py",
    ),
    Mutant(
        "pipeline/stages/logo.py",
        "ball.centre_px(times_us - delay_us)",
        "ball.centre_px(times_us)",
        "tests/pipeline/stages/test_logo.py",
    ),
    Mutant(
        "pipeline/stages/rate.py",
        "(falling_crossings(smooth_hz) + 0.5) * parameters.bin_us",
        "falling_crossings(smooth_hz) * parameters.bin_us",
        "tests/pipeline/stages/test_rate.py",
    ),
    Mutant(
        "pipeline/stages/rate.py",
        "ended = packet.end_us // parameters.bin_us - first_bin",
        "ended = -(-packet.end_us // parameters.bin_us) - first_bin",
        "tests/pipeline/stages/test_rate.py",
    ),
    Mutant(
        "pipeline/stages/rate.py",
        "spread_s > IRREGULAR * mean_s",
        "spread_s > 2 * IRREGULAR * mean_s",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/stages/rate.py",
        "spread_s / mean_s**2 / math.sqrt(intervals_s.size)",
        "spread_s / mean_s**2",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/stages/flow.py",
        "bound_px_s = 2 * math.pi * state.max_spin_rps * logo.radius_px",
        "bound_px_s = math.pi * state.max_spin_rps * logo.radius_px",
        "tests/pipeline/stages/test_flow.py",
    ),
    Mutant(
        "pipeline/stages/flow.py",
        "state.slice_start_us += t_acc_us",
        "state.slice_start_us = end_us",
        "tests/pipeline/stages/test_flow.py",
    ),
    Mutant(
        "pipeline/stages/flow.py",
        "relative = absolute - along @ ball_px_s",
        "relative = absolute",
        "tests/pipeline/stages/test_flow.py",
    ),
    Mutant(
        "pipeline/kernels/kalman.py",
        "spread[4, 4] += (growth_px_s * dt_s) ** 2",
        "spread[4, 4] += growth_px_s * dt_s**2",
        "tests/pipeline/kernels/test_kalman.py",
    ),
    Mutant(
        "pipeline/kernels/kalman.py",
        "kept[i, OBSERVED[b]] -= gain[i, b]",
        "kept[i, OBSERVED[b]] -= gain[b, b]",
        "tests/pipeline/kernels/test_kalman.py",
    ),
    Mutant(
        "pipeline/stages/track_search.py",
        "abs(now.ring[4] - before.ring[4]) <= 1.0 + 0.1 * before.ring[4]",
        "now.ring[4] - before.ring[4] <= 1.0 + 0.1 * before.ring[4]",
        "tests/pipeline/stages/test_track_gates.py",
    ),
    Mutant(
        "pipeline/stages/track_search.py",
        "key=lambda one: (one[0].trusted, one[0].speed_px_s), reverse=True",
        "key=lambda one: (one[0].trusted, one[0].speed_px_s)",
        "tests/pipeline/stages/test_track.py",
    ),
    Mutant(
        "pipeline/stages/track_outline.py",
        "radius + sign * self.outline_px",
        "radius + self.outline_px",
        "tests/pipeline/stages/test_track_gates.py",
    ),
    Mutant(
        "pipeline/stages/track_outline.py",
        "and abs(self.contrast) >= 0.8",
        "and self.contrast >= 0.8",
        "tests/pipeline/stages/test_track_gates.py",
    ),
    Mutant(
        "pipeline/stages/track.py",
        "end_us - ball.seen_us > parameters.coast_us",
        "end_us - ball.seen_us >= parameters.coast_us",
        "tests/pipeline/stages/test_track.py",
    ),
    Mutant(
        "pipeline/stages/track_ball.py",
        "expected = measuring.edge.outline(self.filter.mean)\n        # The velocity",
        "expected = measuring.edge.ball(self.filter.mean)\n        # The velocity",
        "tests/pipeline/stages/test_track.py",
    ),
    Mutant(
        "pipeline/stages/track_extension.py",
        "path, others = list(ball.path), [*flying, *self.gone]",
        "path, others = list(ball.path), list(self.gone)",
        "tests/pipeline/stages/test_track_extension.py",
    ),
    Mutant(
        "pipeline/stages/track_extension.py",
        "while path[-1].circle is None:",
        "while False:",
        "tests/pipeline/stages/test_track_extension.py",
    ),
    Mutant(
        "pipeline/stages/fixed_ball.py",
        "radius_px = float(answer[2]) * (1 + short)",
        "radius_px = float(answer[2])",
        "tests/pipeline/stages/test_fixed_ball.py -k all_around",
    ),
]

KERNELS = [
    Mutant(
        "pipeline/kernels/filter.py",
        "if mode == STC:\n        return same & (pause_us <= threshold_us)",
        "if mode == STC:\n        return same & (pause_us < threshold_us)",
        "tests/pipeline/kernels/test_filter.py tests/pipeline/stages/test_filter.py",
    ),
    Mutant(
        "pipeline/kernels/eros.py",
        "while np.rint(falling[-1]) > 0:",
        "while falling[-1] > 1:",
        "tests/pipeline/kernels/test_eros.py",
    ),
    Mutant(
        "pipeline/kernels/sphere.py",
        "along = -(a * ex + b * ey) / (ex * rx + ey * ry + ez)",
        "along = -(a * ex + b * ey) / ez",
        "tests/pipeline/kernels/test_sphere.py",
    ),
    Mutant(
        "pipeline/kernels/sphere.py",
        "after = min(knot + 1, knots - 1)",
        "after = knot",
        "tests/pipeline/kernels/test_sphere.py",
    ),
    Mutant(
        "pipeline/kernels/rate.py",
        "np.sqrt(early * late)",
        "early",
        "tests/pipeline/kernels/test_rate.py",
    ),
    Mutant(
        "pipeline/kernels/triplet.py",
        "if dt_us <= 0 or on[j] != on[k]:",
        "if dt_us <= 0:",
        "tests/pipeline/kernels/test_triplet.py",
    ),
    Mutant(
        "pipeline/kernels/spin.py",
        "abs(determinant) < 1e-3 * size",
        "determinant == 0.0",
        "tests/pipeline/kernels/test_spin.py",
    ),
    Mutant(
        "pipeline/kernels/logo.py",
        "((ahead > 0.0) == on)",
        "((ahead > 0.0) != on)",
        "tests/pipeline/stages/test_logo.py",
    ),
    Mutant(
        "pipeline/kernels/surfaces.py",
        "recent = last_us >= start_us",
        "recent = last_us > start_us",
        "tests/pipeline/kernels/test_surfaces.py",
    ),
]

MUTANTS = [*STAGES, *KERNELS]
