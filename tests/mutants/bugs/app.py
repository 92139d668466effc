"""Realistic bugs of commands, batch, viewer, web application and coach."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

COMMANDS = [
    Mutant(
        "app/terminal.py",
        "        error = error.__cause__\n",
        "        error = None\n",
        "tests/app/test_signals.py -k wraps",
    ),
    Mutant(
        "app/analysis.py",
        "result = estimate_with_measured_up(session, method, on_progress)",
        "result = estimate_with_measured_up(session, on_progress=on_progress)",
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
        'return any("error" in one.report for one in analyzed)',
        'return all("error" in one.report for one in analyzed)',
        "tests/app/test_analyze.py -k bad_one",
    ),
    Mutant(
        "app/commands/info.py",
        "information(recordings[0], reading, bar)",
        "information(recordings[0], ReadingOptions(), bar)",
        "tests/app/test_info.py",
    ),
]

BATCH = [
    Mutant("app/result_journal.py", "file.truncate(self._end)", "pass", "tests/app/test_batch.py -k on_disk"),
    Mutant(
        "app/result_journal.py", 'if content.endswith(b"\\n"):', "if content:", "tests/app/test_batch.py -k on_disk"
    ),
    Mutant(
        "app/batch.py",
        "(file_identity(path), Sidecar.beside(path).digest) == (entry.recording_hash, entry.sidecar_hash)",
        "file_identity(path) == entry.recording_hash",
        "tests/app/test_batch.py -k changed_ones",
    ),
    Mutant(
        "app/batch.py",
        "sorted(recordings)[work.part[0] - 1 :: work.part[1]]",
        "sorted(recordings)[work.part[0] :: work.part[1]]",
        "tests/app/test_batch.py -k array_job",
    ),
    Mutant(
        "app/batch.py",
        "return digest([*settings, self.method])",
        "return digest(settings)",
        "tests/app/test_batch.py -k overwritten",
    ),
    Mutant(
        "app/table_files.py",
        "writer.write_table(arrow.Table.from_pylist(waiting, schema))\n                waiting.clear()",
        "waiting.clear()",
        "tests/app/test_batch.py",
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
        "np.stack([out, cross_product(pole, out), pole])",
        "np.stack([out, cross_product(out, pole), pole])",
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
        "        if not is_trusted:\n",
        "        if False:\n",
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
        "if name not in (*OWN_HOSTS, *self._hosts):",
        "if not name.startswith((*OWN_HOSTS, *self._hosts)):",
        "tests/app/web/test_security.py",
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

COACH = [
    Mutant(
        "app/coach/statistics.py",
        "if abs(change) <= CLEAR_SIGMAS * std:",
        "if abs(change) <= std:",
        "tests/app/coach/test_terms.py",
    ),
    Mutant(
        "app/coach/statistics.py",
        'best = max(known, key=lambda shot: shot["spin_rps"], default=None)',
        'best = max(known, key=lambda shot: shot["id"], default=None)',
        "tests/app/coach/test_terms.py",
    ),
    Mutant(
        "app/coach/statistics.py",
        "reach = np.sort(_distances(shots, centre, covariance))[count - 1]",
        "reach = np.sort(_distances(shots, centre, covariance))[-1]",
        "tests/app/coach/test_terms.py",
    ),
    Mutant(
        "app/coach/terms.py",
        "math.atan2(-sidespin_rps, -topspin_rps)",
        "math.atan2(sidespin_rps, -topspin_rps)",
        "tests/app/coach/test_terms.py",
    ),
    Mutant(
        "app/coach/terms.py",
        "spin_std_rps <= max(share * spin_rps, ALWAYS_SURE_RPS) and",
        "spin_std_rps <= share * spin_rps and",
        "tests/app/coach/test_terms.py",
    ),
    Mutant(
        "app/coach/session.py",
        "if same is not None and _shared_us(same, shot) > 0:",
        "if same is not None:",
        "tests/app/coach/test_session.py",
    ),
    Mutant("app/coach/session.py", 'row["deleted"] if is_named else 1', "1", "tests/app/coach/test_session.py"),
    Mutant("app/coach/session.py", "row |= now\n", "pass\n", "tests/app/coach/test_session.py"),
    Mutant(
        "app/coach/session.py",
        "WHERE revision > ? ORDER BY",
        "WHERE revision >= ? ORDER BY",
        "tests/app/coach/test_session.py",
    ),
    Mutant(
        "app/coach/session_analysis.py",
        "if all_known.get(str(path)) != known:",
        "if True:",
        "tests/app/coach/test_session.py",
    ),
    Mutant(
        "app/coach/flight_path.py",
        "crossed[2] - BALL_RADIUS_M - NET_HEIGHT_M",
        "crossed[2] - NET_HEIGHT_M",
        "tests/app/coach/test_exports.py -k flight",
    ),
    Mutant(
        "app/coach/flight_path.py",
        "points[:, :2] *= -1",
        "points[:, :1] *= -1",
        "tests/app/coach/test_exports.py -k flight",
    ),
    Mutant(
        "app/coach/shot_words.py",
        "rpm(spin_rps):.0f} {self.text",
        "spin_rps:.0f} {self.text",
        "tests/app/coach/test_exports.py -k words",
    ),
    Mutant(
        "app/coach/logo_texture.py",
        "folded_y = np.where(under, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y)",
        "folded_y = np.where(under, (1 - np.abs(y)) * np.where(y < 0, -1, 1), y)",
        "tests/app/coach/test_terms.py",
    ),
]

MUTANTS = [*COMMANDS, *BATCH, *VIEWER, *WEB, *COACH]
