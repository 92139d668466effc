"""Realistic bugs of chain and values."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

CHAIN = [
    Mutant(
        "pipeline/child_process.py",
        "signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS_OF_PARENT)",
        "signal.pthread_sigmask(signal.SIG_BLOCK, set())",
        "tests/pipeline/test_child_process.py -k signals",
    ),
    Mutant(
        "pipeline/chain.py",
        "self._key(stage.name, parameters.group(stage.group), read, inputs)",
        "self._key(stage.name, parameters.group(stage.group), inputs)",
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
        "self.t_us.searchsorted([start_us, end_us])",
        'self.t_us.searchsorted([start_us, end_us], side="right")',
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
        "pipeline/stages/track_continuation.py",
        "if missed_px < SAME_PLACE * first[4]:",
        "if missed_px >= 0.0:",
        "tests/pipeline/stages/test_track_contact.py -k continues_anothers_path",
    ),
    Mutant(
        "pipeline/stages/track_contact.py",
        "float(within_us[np.argmin(places.costs(within_us))])",
        "float(times_us[np.argmin(costs)])",
        "tests/pipeline/stages/test_track_contact.py -k known_at_once",
    ),
    Mutant(
        "pipeline/stages/track_rim.py",
        "PRINT_SHARE * max(self.mixed - USUAL_MIXED, 0.0) * radius_px",
        "0.0",
        "tests/pipeline/stages/test_track_rim.py -k half_painted",
    ),
    Mutant(
        "pipeline/stages/track_initiation.py",
        "if packet.end_us - since[0] >= parameters.contour_us:",
        "if packet.end_us - since[0] >= 0:",
        "tests/pipeline/stages/test_track.py -k seen_once",
    ),
    Mutant(
        "pipeline/stages/track_contact.py",
        "lower.min() < min(costs.min() - LEAST_GAIN, costs.min() / STRAY_RATIO)",
        "lower.min() < 0.0",
        "tests/pipeline/stages/test_track_contact.py -k rackets_outline",
    ),
    Mutant(
        "pipeline/stages/track_contact.py",
        "if _off_radii(points[stray], path) > STRAY_RADII:",
        "if _off_radii(points[stray], path) > 0.0:",
        "tests/pipeline/stages/test_track_contact.py -k taken_for_a_rackets",
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

MUTANTS = [*CHAIN, *VALUES]
