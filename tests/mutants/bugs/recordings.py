"""Realistic bugs of recordings, cameras and calibration."""

from __future__ import annotations

from tests.mutants.mutation import Mutant

RAW = "tests/pipeline/recordings/test_recordings_raw.py tests/pipeline/recordings/test_recordings_encodings.py"

RECORDINGS = [
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/evt3.py",
        "high_us = now_us = state[decoding.HIGH] << TIME_BITS",
        "high_us = state[decoding.HIGH] << TIME_BITS",
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
        "pipeline/recordings/formats/prophesee_dat/decoding.py",
        "if ahead > TURN_US >> 1 and t >= TURN_US:",
        "if t >= TURN_US:",
        "tests/pipeline/recordings/test_recordings_dat.py",
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_dat/decoding.py",
        "if _is_outside(words[i]) or _is_copy(words, i):",
        "if _is_outside(words[i]):",
        "tests/pipeline/recordings/test_recordings_dat.py",
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_dat/decoding.py",
        "(words[k] - words[k - 1]) & TIME_MASK > MAX_DISORDER_US",
        "(words[k] - words[k - 1]) & TIME_MASK > 200 * MAX_DISORDER_US",
        "tests/pipeline/recordings/test_recordings_dat.py",
    ),
    Mutant(
        "pipeline/recordings/formats/prophesee_raw/evt2.py",
        "heads[at] >> HIGH_BITS <= CD_ON",
        "heads[at] >> HIGH_BITS <= 0x3",
        RAW,
    ),
    Mutant(
        "pipeline/recordings/formats/hdf5/ecf.py",
        "(a & low) | ((b >> 2 * bits) << bits)",
        "(a & low) | (b >> 2 * bits)",
        "tests/pipeline/recordings/test_recordings_ecf.py tests/pipeline/recordings/test_recordings_encodings.py",
    ),
    Mutant(
        "pipeline/recordings/growing_columns.py",
        "self._decoded += events",
        "self._decoded = self.events",
        "tests/pipeline/recordings/test_recordings_streamed.py",
    ),
    Mutant(
        "pipeline/recordings/order.py",
        "late = new.t_us < latest_us - MAX_DISORDER_US",
        "late = new.t_us < latest_us",
        "tests/pipeline/recordings/test_recordings_windows.py",
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

FORMATS = [
    Mutant(
        "pipeline/recordings/formats/event_stream/decoding.py",
        "now_us += low * full",
        "now_us += full",
        "tests/pipeline/recordings/test_recordings_event_stream.py",
    ),
    Mutant(
        "pipeline/recordings/formats/event_stream/decoding.py",
        "is_event = not (is_atis and low & 1)",
        "is_event = True",
        "tests/pipeline/recordings/test_recordings_event_stream.py",
    ),
    Mutant(
        "pipeline/recordings/formats/event_stream/reader.py",
        "data = rest + block",
        "data = block",
        "tests/pipeline/recordings/test_recordings_event_stream.py",
    ),
    Mutant(
        "pipeline/recordings/formats/rosbag/messages.py",
        "-(self.at - self._start) % size",
        "-self.at % (2 * size)",
        "tests/pipeline/recordings/test_recordings_rosbag.py",
    ),
    Mutant(
        "pipeline/recordings/formats/rosbag/messages.py",
        "range(2 if self.is_cdr else 3)",
        "range(2)",
        "tests/pipeline/recordings/test_recordings_rosbag.py",
    ),
    Mutant(
        "pipeline/recordings/formats/rosbag/messages.py",
        ".astype(np.int64) + message.time_base_ns) // 1000",
        ".astype(np.int64)) // 1000",
        "tests/pipeline/recordings/test_recordings_rosbag.py",
    ),
    Mutant(
        "pipeline/recordings/formats/rosbag/messages.py",
        'rows["s"].astype(np.int64) * 1_000_000',
        'rows["s"] * np.uint32(1_000_000)',
        "tests/pipeline/recordings/test_recordings_rosbag.py",
    ),
    Mutant(
        "pipeline/recordings/clock_segments.py",
        "self.shift_us += self._latest_us - first_us",
        "self.shift_us = self._latest_us - first_us",
        "tests/pipeline/recordings/test_recordings_segments.py",
    ),
    Mutant(
        "pipeline/recordings/clock_segments.py",
        "return run.size == SEGMENT_EVENTS and in_order and",
        "return run.size == SEGMENT_EVENTS and",
        "tests/pipeline/recordings/test_recordings_segments.py",
    ),
    Mutant(
        "pipeline/recordings/clock_segments.py",
        "if not self._has_begun and len(before) < SEGMENT_EVENTS:",
        "if not self._has_begun:",
        "tests/pipeline/recordings/test_recordings_segments.py",
    ),
    Mutant(
        "pipeline/recordings/time_units.py",
        "return np.rint(times.astype(np.float64) * UNITS_US[unit]).astype(np.int64)",
        "return (times.astype(np.float64) * UNITS_US[unit]).astype(np.int64)",
        "tests/pipeline/recordings/test_recordings_columns.py tests/pipeline/recordings/test_recordings_text.py",
    ),
    Mutant(
        "pipeline/recordings/event_counts.py",
        "        if low_byte == 0:\n",
        "        if low_byte == 255:\n",
        "tests/pipeline/recordings/test_recordings_summary.py",
    ),
    Mutant(
        "pipeline/isolation.py",
        "            wish = STOP\n",
        "            wish = NEXT\n",
        "tests/pipeline/test_isolation.py",
    ),
    Mutant(
        "pipeline/spin_process.py",
        "not in self._given:",
        "is not None:",
        "tests/pipeline/test_spin_process.py -k killed",
    ),
    Mutant(
        "pipeline/recording_folders.py",
        "                and path.absolute() not in not_these\n",
        "",
        "tests/app/test_batch.py -k found_once",
    ),
    Mutant("pipeline/text_table.py", 'text = text.replace(",", ".")', "pass", "tests/pipeline/test_truth_table.py"),
]

CAMERAS = [
    Mutant(
        "pipeline/cameras/event_stream.py",
        "counts.late += len(events) - len(on_time)",
        "pass",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "int(events.t_us[0]) // self._tick_us * self._tick_us",
        "int(events.t_us[0])",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "self._segment += 1  # what follows the gap",
        "pass",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "self._segment += 1\n        self._clock += 1",
        "self._segment += 1",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "while self._next_us is not None and packet.end_us >= self._next_us + self._tick_us:",
        "while self._next_us is not None and packet.end_us >= self._next_us + self._tick_us - 1:",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "if is_behind or (self._skipping and self.waiting):",
        "if is_behind:",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/recorder.py",
        "(clock != self._clock or is_full)",
        "is_full",
        "tests/pipeline/cameras/test_recorder.py",
    ),
    Mutant(
        "pipeline/cameras/recorder.py",
        'path.with_suffix(suffix).write_text(text, encoding="utf-8")',
        'self.path.with_suffix(suffix).write_text(text, encoding="utf-8")',
        "tests/pipeline/cameras/test_recorder.py",
    ),
    Mutant(
        "pipeline/cameras/recorder.py",
        "int(events.t_us[-1]) - start_us > self._most_us",
        "int(events.t_us[-1]) > self._most_us",
        "tests/pipeline/cameras/test_recorder.py",
    ),
    Mutant(
        "pipeline/cameras/recent_events.py",
        "self._events -= len(self._kept.popleft().events)",
        "self._kept.popleft()",
        "tests/app/test_live.py -k bounded",
    ),
    Mutant(
        "pipeline/cameras/recent_events.py",
        "of_clock = (one for one in self._kept if one.clock == clock)",
        "of_clock = (one for one in self._kept)",
        "tests/app/test_live.py -k bounded",
    ),
    Mutant(
        "pipeline/cameras/recent_events.py",
        "return self._needed is None or",
        "return True or",
        "tests/app/test_live.py -k kept",
    ),
    Mutant(
        "pipeline/cameras/event_stream.py",
        "if said_us is None or not 0 <= now_us - said_us < SAID_US:",
        "if said_us is None:",
        "tests/pipeline/cameras/test_event_stream.py",
    ),
    Mutant(
        "pipeline/cameras/replay.py",
        "np.maximum(events.t_us - self._reset_us, 0)",
        "events.t_us",
        "tests/pipeline/cameras/test_replay.py",
    ),
    Mutant(
        "pipeline/cameras/replay.py",
        "begin_us = first_us if last_us is None else min(last_us, first_us)",
        "begin_us = first_us",
        "tests/pipeline/cameras/test_replay.py",
    ),
    Mutant(
        "pipeline/cameras/drivers/neuromorphic.py",
        "status.ring.dropped_packets - self._dropped, status.ring.dropped_packets",
        "status.ring.dropped_packets, status.ring.dropped_packets",
        "tests/pipeline/cameras/test_neuromorphic.py",
    ),
    Mutant(
        "pipeline/cameras/drivers/neuromorphic.py",
        '(events["x"] < self.width_px) & (events["y"] < self.height_px)',
        '(events["x"] < self.width_px) & (events["y"] <= self.height_px)',
        "tests/pipeline/cameras/test_neuromorphic.py",
    ),
    Mutant(
        "app/live/shot_table.py",
        "os.truncate(self._rows, sum(map(len, lines)))",
        "pass",
        "tests/app/test_live.py -k after_a_crash",
    ),
    Mutant("app/live/json_lines.py", "self._clients.remove(client)", "pass", "tests/app/test_live.py -k every_line"),
    Mutant(
        "app/live/recording.py",
        "round(chosen.most_s * 1e6)",
        "round(chosen.most_s * 1e3)",
        "tests/app/test_live.py -k lines_and_recording",
    ),
]

CALIBRATION = [
    Mutant(
        "pipeline/calibration/ball_labels.py",
        "places - acceleration * EXPOSURE_US**2 / 8 + LAG_PX",
        "places + LAG_PX",
        "tests/pipeline/calibration/test_ball_labels.py",
    ),
    Mutant(
        "pipeline/calibration/ball_labels.py",
        "width / 2 - OUTSIDE_PX)",
        "width / 2)",
        "tests/pipeline/calibration/test_ball_labels.py",
    ),
    Mutant(
        "pipeline/calibration/ball_labels.py",
        "begin_us + EXPOSURE_US / 2 - LATENCY_US",
        "begin_us + EXPOSURE_US - LATENCY_US",
        "tests/pipeline/calibration/test_ball_labels.py",
    ),
    Mutant(
        "pipeline/calibration/ball_labels.py",
        "seen[around <= NEIGHBOURS] = 0",
        "seen[around < NEIGHBOURS] = 0",
        "tests/pipeline/calibration/test_ball_labels.py",
    ),
    Mutant(
        "pipeline/calibration/camera_calibration.py",
        "good = fit.view_px <= OUTLIER_RATIO * np.median(fit.view_px)",
        "good = fit.view_px >= 0",
        "tests/pipeline/calibration/test_camera_calibration.py",
    ),
    Mutant(
        "pipeline/calibration/camera_calibration.py",
        "matrix[0, 2], matrix[1, 2], *distortion",
        "matrix[1, 2], matrix[0, 2], *distortion",
        "tests/pipeline/calibration/test_camera_calibration.py",
    ),
    Mutant(
        "pipeline/calibration/camera_calibration.py",
        "camera.focal_px * self.pixel_um / 1000.0",
        "camera.focal_px / self.pixel_um",
        "tests/pipeline/calibration/test_camera_calibration.py",
    ),
]

MUTANTS = [*RECORDINGS, *FORMATS, *CAMERAS, *CALIBRATION]
