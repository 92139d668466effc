"""Realistic bugs of spin methods, simulator and evaluation."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

METHODS = [
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "(on < LEAST_OF_POLARITY and not all(state.is_bright))",
        "on < LEAST_OF_POLARITY",
        "tests/pipeline/spin/test_contrast_trust.py",
    ),
    Mutant(
        "pipeline/spin/combined/stage.py",
        'if contrast.pattern == "unclear":\n        return None, []',
        "if False:\n        return None, []",
        "tests/pipeline/spin/test_combined.py",
    ),
    Mutant(
        "pipeline/spin/combined/stage.py",
        'if contrast.pattern == "off_rhythm":\n        return None, []',
        "if False:\n        return None, []",
        "tests/pipeline/spin/test_combined.py",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "0.5 * rhythms_rps[rhythms_rps > flow_rps + RHYTHM_SIGMAS * flow_std_rps]",
        "0.5 * rhythms_rps",
        "tests/pipeline/spin/test_contrast_trust.py",
    ),
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
        "common + fit.overlap * inverse",
        "fit.overlap * inverse",
        "tests/pipeline/stages/test_spin_refusals.py",
    ),
    Mutant(
        "pipeline/kernels/derotated_normal_flow.py",
        "moved[p, k] * moved[q, k] + bent",
        "bent",
        "tests/pipeline/kernels/test_derotated_normal_flow.py -k common",
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
    Mutant(
        "pipeline/spin/normal_flow.py",
        'if contrast is not None and contrast.status == "ok":',
        'if contrast is not None and contrast.status == "refused":',
        "tests/pipeline/test_trusted_method.py",
    ),
]

CONTRAST = [
    Mutant(
        "pipeline/spin/contrast/search.py",
        "span_s = max(min(even_s, stretch.span_s), 1e-5)",
        "span_s = stretch.span_s",
        "tests/pipeline/spin/test_contrast_uncertainty.py -k stray",
    ),
    Mutant(
        "pipeline/spin/contrast/search.py",
        "if polarity[i] != polarity[j]:",
        "if polarity[i] > polarity[j]:",
        "tests/pipeline/spin/test_contrast_uncertainty.py -k coincide",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "may_be_outline or answer.linked_share < LEAST_LINKED:",
        "may_be_outline:",
        "tests/pipeline/spin/test_contrast_trust.py -k fit_together",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "(MORE_OF_VISIT if state.reason == UNLINKED else MORE)",
        "MORE",
        "tests/pipeline/stages/test_contrast_memory.py -k after_a_refusal",
    ),
    Mutant(
        "pipeline/spin/contrast/estimate.py",
        "APART_S = 0.5e-3",
        "APART_S = 0.0",
        "tests/pipeline/spin/test_contrast_uncertainty.py -k visits_meet",
    ),
    Mutant(
        "pipeline/spin/contrast/score.py",
        "others = last - first - (removed - kept)",
        "others = last - first - 1",
        "tests/pipeline/spin/test_contrast_score.py -k twins",
    ),
    Mutant(
        "pipeline/spin/contrast/estimate.py",
        "margins if ball.is_flying else IN_PLACE * margins",
        "IN_PLACE * margins",
        "tests/pipeline/spin/test_contrast_score.py -k in_place",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "centre_std_px=max(math.hypot(position, speed * LATENCY_SPREAD_S), 0.01)",
        "centre_std_px=max(position, 0.01)",
        "tests/pipeline/stages/test_contrast_memory.py -k flies_on",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "None if one_pattern and _may_be_one_of(parameters, answer, normal_flow) else FLOW_METHOD",
        "FLOW_METHOD",
        "tests/pipeline/stages/test_contrast_memory.py -k nothing_turns",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "spins_rps = (answer.spin_rps, *answer.rivals_rps)",
        "spins_rps = (answer.spin_rps, *answer.rivals_rps + 12.0)",
        "tests/pipeline/stages/test_contrast_memory.py -k two_spins_open",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "np.linalg.solve(one.covariance_rps2 + other.covariance_rps2, off)",
        "np.linalg.solve(one.covariance_rps2, off)",
        "tests/pipeline/stages/test_contrast_memory.py -k heard_from",
    ),
    Mutant(
        "pipeline/spin/contrast/stage.py",
        "return refused and count >= (MORE_OF_VISIT if state.reason == UNLINKED else MORE) * state.tried",
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
        "(magnitude > GROSS_RPS or (isinstance(axis, float) and axis > GROSS_DEG))",
        "magnitude > GROSS_RPS",
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

MUTANTS = [*METHODS, *CONTRAST, *SIMULATOR, *EVALUATION]
