"""Realistic bugs, one at a time, each with the tests that ought to notice it."""

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
    Mutant("pipeline/chain.py", "column.fault = error", "pass", "tests/pipeline/test_chain.py"),
    Mutant(
        "pipeline/chain.py",
        "one.first + len(one.results) > last[shot] for",
        "len(one.results) > 0 for",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "key=lambda k: self._columns[k].last_use",
        "key=lambda k: -self._columns[k].last_use",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "results.update(flying[0].results)",
        "results.update(flying[-1].results)",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "if not self.source.growing and self.source.end_us % tick_us:",
        "if self.source.end_us % tick_us:",
        "tests/pipeline/test_chain.py",
    ),
    Mutant(
        "pipeline/chain.py",
        "chain, key = self._chain, (self._keys[stage.name], shot)",
        "chain, key = self._chain, (self._keys[stage.name], None)",
        "tests/pipeline/test_chain.py",
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
        "np.sqrt(np.diag(row.track.covariance))",
        "np.diag(row.track.covariance)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/shots.py",
        "estimates, doubt = rows[-1].estimates,",
        "estimates, doubt = rows[0].estimates,",
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
        "rows = [row for row in self._flying.pop(end.shot) if row.end_us <= end.end_us]",
        "rows = self._flying.pop(end.shot)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/track_evidence.py",
        "self.most_in_row < FEWEST_IN_ROW or self.longest_row_us < SHORTEST_US",
        "self.most_in_row < FEWEST_IN_ROW and self.longest_row_us < SHORTEST_US",
        "tests/pipeline/test_track_evidence.py",
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
        "pipeline/shots.py",
        "np.clip(estimate.axis @ spin / magnitude, -1, 1)",
        "np.clip(abs(estimate.axis @ spin) / magnitude, -1, 1)",
        "tests/pipeline/test_shots.py",
    ),
    Mutant(
        "pipeline/session.py",
        "(int(events.t_us[0]), int(events.t_us[-1]) + 1)",
        "(int(events.t_us[0]), int(events.t_us[-1]))",
        "tests/pipeline/test_session.py -k every_event",
    ),
    Mutant(
        "pipeline/session.py",
        "identity = (self.recording.identity(), (start_us, end_us))",
        "identity = self.recording.identity()",
        "tests/pipeline/test_session.py -k different_sources",
    ),
    Mutant(
        "pipeline/session.py",
        'f"camera.{name}" in attributes and f"camera.{name}" not in chosen',
        'f"camera.{name}" in attributes',
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
        "pipeline/stages/fixed_ball.py",
        "radius_px = float(answer[2]) * (1 + short)",
        "radius_px = float(answer[2])",
        "tests/pipeline/stages/test_fixed_ball.py -k all_around",
    ),
]

METHODS = [
    Mutant(
        "pipeline/spin/triplet.py",
        "np.cov(spins.T) / len(spins)",
        "np.cov(spins.T)",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/spin/triplet.py",
        "scaled = across @ covariance_rps2 @ across * (rate.spin_rps / length) ** 2",
        "scaled = across @ covariance_rps2 @ across",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/spin/normal_flow.py",
        "own = ~logo.of_outline",
        "own = np.ones(len(logo.events), np.bool_)",
        "tests/pipeline/stages/test_spin_refusals.py -k evidence",
    ),
    Mutant(
        "pipeline/spin/normal_flow.py",
        "fit.overlap * inverse + place + bent",
        "fit.overlap * inverse + bent",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/spin/normal_flow.py",
        "max(fit.scale, 1.0) ** 2",
        "max(fit.scale, 1.0)",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/spin/normal_flow.py",
        "off_rps = rate.spin_rps + turned_rps - float(",
        "off_rps = rate.spin_rps - float(",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/spin/normal_flow.py",
        'any(other.against == "normal_flow" for other in estimates.values())',
        "any(other.against for other in estimates.values())",
        "tests/pipeline/test_trusted_method.py",
    ),
]

RAW = "tests/pipeline/recordings/test_recordings_raw.py tests/pipeline/recordings/test_recordings_encodings.py"

RECORDINGS = [
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/evt3.py",
        "state[decoding.LOW] = 0  # the new TIME_LOW comes right after",
        "pass",
        RAW,
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/evt2.py",
        "(word >> TIME_SHIFT) & LOW_MASK)\n            mask",
        "(word >> TIME_SHIFT) & 0xF)\n            mask",
        RAW,
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/decoding.py",
        "if ahead > turn >> 1 and high + ahead >= turn:",
        "if high + ahead >= turn:",
        RAW,
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/reader.py",
        "self._rest = data[done * self._word_bytes :]",
        'self._rest = b""',
        RAW,
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/writer.py",
        "if out.state[ROW] != y_px[i]:",
        "if out.state[ROW] < y_px[i]:",
        "tests/pipeline/recordings/test_recordings_writing.py",
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/decoding.py",
        "if steps == 2 or count == LOOK_AHEAD_STEPS:",
        "if steps == 1 or count == LOOK_AHEAD_STEPS:",
        RAW,
    ),
    Mutant(
        "pipeline/recordings/dat_decoding.py",
        "if ahead > TURN_US >> 1 and t >= TURN_US:",
        "if t >= TURN_US:",
        "tests/pipeline/recordings/test_recordings_dat.py",
    ),
    Mutant(
        "pipeline/recordings/dat_decoding.py",
        "if _is_copy(words, i):",
        "if False:",
        "tests/pipeline/recordings/test_recordings_dat.py",
    ),
    Mutant(
        "pipeline/recordings/formats/hdf5/ecf.py",
        "(a & low) | ((b >> 2 * bits) << bits)",
        "(a & low) | (b >> 2 * bits)",
        "tests/pipeline/recordings/test_recordings_columns.py tests/pipeline/recordings/test_recordings_encodings.py",
    ),
    Mutant(
        "pipeline/recordings/order.py",
        "late = new.t_us < latest_us - MAX_DISORDER_US",
        "late = new.t_us < latest_us",
        "tests/pipeline/recordings/test_recordings_columns.py",
    ),
    Mutant(
        "pipeline/recordings/column_types.py",
        "(p == 1) | (p == 0) | (p == -1)",
        "(p == 1) | (p == 0)",
        "tests/pipeline/recordings/test_recordings_columns.py",
    ),
    Mutant(
        "pipeline/recordings/recording.py",
        "reading.damage.outside_events += int(np.count_nonzero(~inside))",
        "pass",
        "tests/pipeline/recordings/test_recordings_columns.py tests/pipeline/recordings/test_recordings_opening.py",
    ),
    Mutant(
        "pipeline/recordings/sensor.py",
        "min(fitting, key=lambda s: s[0] * s[1])",
        "max(fitting, key=lambda s: s[0] * s[1])",
        "tests/pipeline/recordings/test_recordings_opening.py",
    ),
    Mutant("pipeline/files.py", "os.replace(part, target)", "os.replace(part, path)", "tests/pipeline/test_files.py"),
]

SIMULATOR = [
    Mutant(
        "pipeline/simulator/motion.py",
        "return gx - brake * vx + lift * ax,",
        "return gx - brake * vx - lift * ax,",
        "tests/pipeline/simulator/test_simulator_motion.py",
    ),
    Mutant(
        "pipeline/simulator/motion.py",
        "fade = math.exp(-flight.spin_decay_hz * h)",
        "fade = math.exp(-flight.spin_decay_hz * STEP_S)",
        "tests/pipeline/simulator/test_simulator_motion.py",
    ),
    Mutant(
        "pipeline/simulator/kernels_pixel.py",
        "tau = physics.tau_us + physics.dark_tau_us / intensity",
        "tau = physics.tau_us + physics.dark_tau_us",
        "tests/pipeline/simulator/test_simulator_pixel.py",
    ),
    Mutant(
        "pipeline/simulator/kernels_pixel.py",
        "logo = 1 if change_plain / change < 0.5 else 0",
        "logo = 1 if change / change_plain < 0.5 else 0",
        "tests/pipeline/simulator/test_simulator_pixel.py tests/pipeline/simulator/test_simulator_recordings.py",
    ),
    Mutant(
        "pipeline/simulator/kernels_pixel.py",
        "state[p, OFF_FROM] = when + physics.off_after_on_us",
        "state[p, OFF_FROM] = when",
        "tests/pipeline/simulator/test_simulator_pixel.py",
    ),
]

CONTRAST = [
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "centre_std_px=max(math.hypot(position, speed * LATENCY_SPREAD_S), 0.01)",
        "centre_std_px=max(position, 0.01)",
        "tests/pipeline/stages/test_contrast_memory.py -k flies_on",
    ),
    Mutant(
        "pipeline/spin/contrast/trust.py",
        "None if turns_seen else FLOW_METHOD",
        "FLOW_METHOD",
        "tests/pipeline/stages/test_contrast_memory.py -k nothing_turns",
    ),
    Mutant(
        "pipeline/spin/contrast/trust.py",
        "np.linalg.solve(one.covariance_rps2 + other.covariance_rps2, off)",
        "np.linalg.solve(one.covariance_rps2, off)",
        "tests/pipeline/stages/test_contrast_memory.py -k heard_from",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "return refused and count >= MORE * state.tried",
        "return refused",
        "tests/pipeline/stages/test_contrast_memory.py -k are_due",
    ),
    Mutant(
        "pipeline/spin/contrast/estimate.py",
        "margins = gaps.sum(axis=1) / np.sqrt(",
        "margins = 2.0 * gaps.sum(axis=1) / np.sqrt(",
        "tests/pipeline/spin/test_contrast_score.py -k margins",
    ),
    Mutant(
        "pipeline/spin/contrast/score.py",
        "weight = (last - first - 1) / max(end - begin, 1)",
        "weight = (last - first) / max(end - begin, 1)",
        "tests/pipeline/spin/test_contrast_score.py -k twins",
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

EVALUATION = [
    Mutant(
        "pipeline/evaluation/uncertainty_calibration.py",
        "met = met and (value >= limit if at_least else value <= limit)",
        "met = value >= limit if at_least else value <= limit",
        "tests/pipeline/evaluation/test_uncertainty_calibration.py",
    ),
    Mutant(
        "pipeline/evaluation/uncertainty_calibration.py",
        "both = sorted((float(s), float(e)) for s, e in pairs",
        "both = sorted((float(e), float(e)) for s, e in pairs",
        "tests/pipeline/evaluation/test_uncertainty_calibration.py",
    ),
    Mutant(
        "pipeline/evaluation/uncertainty_calibration.py",
        "(magnitude > GROSS_RPS or axis > GROSS_DEG)",
        "(magnitude > GROSS_RPS and axis > GROSS_DEG)",
        "tests/pipeline/evaluation/test_uncertainty_calibration.py",
    ),
    Mutant(
        "pipeline/evaluation/tables.py",
        "return cls(len(good), len(attempts), statistics",
        "return cls(len(good), len(good), statistics",
        "tests/pipeline/evaluation/test_tables.py",
    ),
    Mutant(
        "pipeline/evaluation/tasks.py",
        "return [row for number in range(len(tasks)) for row in rows[number]]",
        "return [row for number in rows for row in rows[number]]",
        "tests/pipeline/evaluation/test_tasks.py -k order",
    ),
    Mutant(
        "pipeline/spin_terms.py",
        "_degrees(abs(parts[main]) / magnitude)",
        "_degrees(parts[main] / magnitude)",
        "tests/pipeline/test_spin_terms.py",
    ),
    Mutant(
        "pipeline/spin_terms.py", "if abs(value) >= WORTH", "if value >= WORTH", "tests/pipeline/test_spin_terms.py"
    ),
    Mutant(
        "pipeline/simulator/sensor.py",
        'noise_on = value["noise_on_factor"] * common * refractory',
        'noise_on = value["noise_on_factor"] * common / refractory',
        "tests/pipeline/simulator/test_simulator_biases.py",
    ),
]

COMMANDS = [
    Mutant(
        "app/commands/analyze.py",
        "result = session.estimate(method, on_progress)",
        "result = session.estimate(on_progress=on_progress)",
        "tests/app/test_analyze.py -k one_method_only",
    ),
    Mutant(
        "app/commands/options.py",
        "if value and value[0] >= value[1]:",
        "if value and value[0] > value[1]:",
        "tests/app/test_analyze.py -k wrong_input",
    ),
    Mutant(
        "app/commands/analyze.py",
        'if any("error" in report for report in reports):',
        'if all("error" in report for report in reports):',
        "tests/app/test_analyze.py -k bad_one",
    ),
    Mutant(
        "app/commands/info.py",
        "information(recordings[0], reading, bar)",
        "information(recordings[0], ReadingOptions(), bar)",
        "tests/app/test_info.py",
    ),
]

VIEWER = [
    Mutant(
        "app/viewer/score.py",
        "right = np.where(axes[:, 2] < 0, 0,",
        "right = np.where(axes[:, 2] > 0, 0,",
        "tests/app/viewer/test_score.py -k axes_lie",
    ),
    Mutant(
        "app/viewer/score.py",
        "mark.height * y.max(initial=0.0)",
        "abs(mark.height) * y.max(initial=0.0)",
        "tests/app/viewer/test_score.py -k rivals_stand",
    ),
    Mutant(
        "app/viewer/ball_projections.py",
        "front * [-1, 1, -1]",
        "front * [1, 1, -1]",
        "tests/app/viewer/test_ball_projections.py",
    ),
    Mutant(
        "app/viewer/ball_projections.py",
        "np.stack([out, np.cross(pole, out), pole])",
        "np.stack([out, np.cross(out, pole), pole])",
        "tests/app/viewer/test_ball_projections.py",
    ),
    Mutant(
        "app/viewer/derotated_logo.py",
        "(start_us - t_us) * 1e-6",
        "(t_us - start_us) * 1e-6",
        "tests/app/viewer/test_derotated_logo.py tests/app/viewer/test_ball.py",
    ),
    Mutant(
        "app/viewer/summary.py",
        "if self.answer is None or not self.answer[2]:",
        "if self.answer is None:",
        "tests/app/viewer/test_summary.py -k doubt",
    ),
]

WEB = [
    Mutant(
        "app/web/message_queue.py",
        "if request.serial <= self._newest:",
        "if request.serial < self._newest:",
        "tests/app/web/test_client_session.py -k supersedes",
    ),
    Mutant(
        "app/web/message_queue.py",
        'slot = message.kind, getattr(message, "picture", None) is not None',
        "slot = message.kind, False",
        "tests/app/web/test_client_session.py -k unread_picture",
    ),
    Mutant(
        "app/web/jobs.py",
        'self._put("cancelled")',
        'self._put("done")',
        "tests/app/web/test_client_session.py -k a_job_tells",
    ),
    Mutant(
        "app/web/security.py",
        "if not OWN_HOST.fullmatch(host):",
        "if not OWN_HOST.match(host):",
        "tests/app/web/test_application.py -k strangers",
    ),
    Mutant(
        "app/web/presets.py",
        "return Parameters().with_values(setup_of(opened)).with_values(values, on_rename)",
        "return Parameters().with_values(values).with_values(setup_of(opened))",
        "tests/app/web/test_presets.py",
    ),
    Mutant("app/web/presets.py", "line = shlex.join(words)", 'line = " ".join(words)', "tests/app/web/test_presets.py"),
    Mutant(
        "app/tuning/parameter_sweep.py",
        "return sorted({int(value) for value in np.rint(found)})",
        "return [int(value) for value in np.rint(found)]",
        "tests/app/web/test_tools.py -k span_the_range",
    ),
]

MUTANTS = [
    *CHAIN,
    *VALUES,
    *STAGES,
    *METHODS,
    *CONTRAST,
    *KERNELS,
    *RECORDINGS,
    *SIMULATOR,
    *EVALUATION,
    *COMMANDS,
    *VIEWER,
    *WEB,
]
