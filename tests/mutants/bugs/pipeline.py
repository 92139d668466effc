"""Realistic bugs of chain, values, stages and kernels."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

CHAIN = [
    Mutant(
        "pipeline/chain.py",
        "keys[stage.name] = (stage.name, parameters.group(stage.group), read, inputs)",
        "keys[stage.name] = (stage.name, parameters.group(stage.group), inputs)",
        "tests/pipeline/test_cache_keys.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "parameters.track.tick_us, parameters.camera, parameters.ball)",
        "parameters.track.tick_us, parameters.ball)",
        "tests/pipeline/test_cache_keys.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "min((number + 1) * tick_us, self.source.end_us)",
        "(number + 1) * tick_us",
        "tests/pipeline/test_chain.py",
    ),
    Mutant("pipeline/column_cache.py", "column.fault = error", "pass", "tests/pipeline/test_chain.py"),
    Mutant(
        "pipeline/column_cache.py",
        "column.first + len(column.results) > index",
        "len(column.results) > 0",
        "tests/pipeline/test_chain_balls.py",
    ),
    Mutant(
        "pipeline/column_cache.py",
        "key=lambda k: self._columns[k].last_use",
        "key=lambda k: -self._columns[k].last_use",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "results.update(flying[0].results)",
        "results.update(flying[-1].results)",
        "tests/pipeline/test_chain_balls.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "if not self.source.growing and self.source.end_us % tick_us:",
        "if self.source.end_us % tick_us:",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "key = (self._keys[stage.name], shot)",
        "key = (self._keys[stage.name], None)",
        "tests/pipeline/test_chain_balls.py",
    ),
    Mutant(
        "pipeline/registry.py",
        "for method in reversed(methods()) if",
        "for method in methods() if",
        "tests/pipeline/test_trusted_method.py",
    ),
    Mutant(
        "pipeline/registry.py",
        '*(("ball",) if stage.scope == "ball" else ())',
        "",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/stage.py",
        "return self.values[name]",
        "return self.values.get(name)",
        "tests/pipeline/test_cache_keys.py",
    ),
]

VALUES = [
    Mutant(
        "pipeline/parameters.py",
        "if not low <= value <= high:",
        "if not low <= value:",
        "tests/pipeline/test_parameters.py",
    ),
    Mutant(
        "pipeline/parameters.py",
        "new_name = self.renamed.get(name, name)",
        "new_name = name",
        "tests/pipeline/test_parameters.py",
    ),
    Mutant(
        "pipeline/events.py",
        "np.searchsorted(self.t_us, [start_us, end_us])",
        'np.searchsorted(self.t_us, [start_us, end_us], side="right")',
        "tests/pipeline/test_events.py",
    ),
    Mutant(
        "pipeline/events.py", "int(column.max()) >= size", "int(column.max()) > size", "tests/pipeline/test_events.py"
    ),
    Mutant(
        "pipeline/camera.py",
        "(width_px - 1) / 2 if x is None",
        "width_px / 2 if x is None",
        "tests/pipeline/test_camera.py",
    ),
    Mutant(
        "pipeline/camera.py", "stretch = cos2_theta / q", "stretch = np.ones_like(q)", "tests/pipeline/test_camera.py"
    ),
    Mutant(
        "pipeline/camera.py",
        "x * radial + 2 * p1 * x * y",
        "x * radial - 2 * p1 * x * y",
        "tests/pipeline/test_camera.py",
    ),
    Mutant(
        "pipeline/camera.py", "x / (1 + u) * z_m, y / (1 + u)", "x * z_m, y / (1 + u)", "tests/pipeline/test_camera.py"
    ),
    Mutant(
        "pipeline/results.py",
        "across = float(np.trace(self.covariance_rps2) - axis @ self.covariance_rps2 @ axis)",
        "across = float(np.trace(self.covariance_rps2))",
        "tests/pipeline/test_results.py",
    ),
    Mutant(
        "pipeline/results.py",
        'return "refused" if self.vector_rps is None else "ok"',
        'return "refused" if self.reason else "ok" if self.magnitude_rps else "refused"',
        "tests/pipeline/test_results.py",
    ),
    Mutant(
        "pipeline/shots.py",
        "np.sqrt(np.diag(track.covariance))",
        "np.diag(track.covariance)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/shots.py",
        "first, last = self._first, self.last_until(end.end_us)",
        "first, last = self._first, self._recent[0]",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/shots.py",
        "return sorted(self._ended, key=lambda shot: shot.start_us)",
        "return list(self._ended)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant("pipeline/shots.py", "end_us=end.end_us", "end_us=rows[-1].end_us", "tests/pipeline/test_shots.py"),
    Mutant(
        "pipeline/shots.py",
        "rows = np.array(self._numbers[: self.ticks_until(end.end_us)])",
        "rows = np.array(self._numbers)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/track_evidence.py",
        "self.most_in_row < FEWEST_IN_ROW or self.longest_row_us < SHORTEST_US",
        "self.most_in_row < FEWEST_IN_ROW and self.longest_row_us < SHORTEST_US",
        "tests/pipeline/test_track_evidence.py",
    ),
    Mutant(
        "pipeline/stages/track.py",
        "contact.path.roughness < SAME_BALL_ROUGHNESS",
        "contact.path.roughness > 0.0",
        "tests/pipeline/stages/test_track_contact.py -k continues_its_path",
    ),
    Mutant(
        "pipeline/stages/track_contact.py",
        "lower.min() < min(costs.min() - LEAST_GAIN, costs.min() / STRAY_RATIO)",
        "lower.min() < 0.0",
        "tests/pipeline/stages/test_track_contact.py -k rackets_outline",
    ),
    Mutant(
        "pipeline/spin/combined/stage.py",
        "if odds < parameters.odds:",
        "if odds < 1.0:",
        "tests/pipeline/spin/test_combined.py",
    ),
    Mutant(
        "pipeline/kernels/sightings.py",
        "counts[zone] * math.log(1.0 - chance) + counts[3 + zone] * math.log(chance)",
        "counts[3 + zone] * math.log(chance)",
        "tests/pipeline/kernels/test_sightings.py",
    ),
    Mutant(
        "pipeline/spin/combined/sightings.py",
        "seen = counts >= max(",
        "seen = counts > -max(",
        "tests/pipeline/spin/test_combined.py",
    ),
    Mutant(
        "pipeline/spin/combined/stage.py",
        "apart @ apart > (NEAR * np.linalg.norm(alone.vector_rps)) ** 2",
        "apart @ apart > 0.0",
        "tests/pipeline/spin/test_combined.py",
    ),
    Mutant(
        "pipeline/spin/trajectory/stage.py",
        "axis_std <= TRUSTED_AXIS_DEG and std <=",
        "axis_std <= TRUSTED_AXIS_DEG or std <=",
        "tests/pipeline/test_trusted_method.py",
    ),
    Mutant(
        "pipeline/spin/trajectory/likelihood.py",
        "known = set_up.gravity_m_s2 + set_up.drag_per_m * brake",
        "known = set_up.gravity_m_s2 - set_up.drag_per_m * brake",
        "tests/pipeline/spin/test_trajectory.py",
    ),
    Mutant(
        "pipeline/shots.py",
        '"y_std_px": std["y_px"]',
        '"y_std_px": std["x_px"]',
        "tests/pipeline/test_results.py",
    ),
    Mutant(
        "pipeline/results.py",
        "cosine = float(found_rps @ true_rps)",
        "cosine = abs(float(found_rps @ true_rps))",
        "tests/pipeline/test_shots.py tests/pipeline/test_results.py",
    ),
    Mutant(
        "pipeline/recordings/source.py",
        "(int(events.t_us[0]), int(events.t_us[-1]) + 1)",
        "(int(events.t_us[0]), int(events.t_us[-1]))",
        "tests/pipeline/test_session.py -k every_event",
    ),
    Mutant(
        "pipeline/recordings/source.py",
        "EventsInMemory((recording.identity(), window_us), events",
        "EventsInMemory((recording.identity(),), events",
        "tests/pipeline/test_session.py -k different_sources",
    ),
    Mutant(
        "pipeline/session.py",
        'if f"{group}.{name}" in attributes and f"{group}.{name}" not in chosen',
        'if f"{group}.{name}" in attributes',
        "tests/pipeline/test_session.py -k user_says",
    ),
]

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

MUTANTS = [*CHAIN, *VALUES, *STAGES, *KERNELS]
