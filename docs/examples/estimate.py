"""Estimate the spin of a recorded shot with the Python API, plot its track, and see what a parameter changes.

    uv run python docs/examples/estimate.py                      # a sample recording, the plot in a window
    uv run python docs/examples/estimate.py MY.raw track.png     # a recording of your own, the plot in a file

`notebook.ipynb` beside this file goes the same way.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import spinscope

SAMPLE = Path(__file__).parents[2] / "sample_recordings" / "flight_fast_top.h5"


def print_result(result: spinscope.Result) -> None:
    """Print every shot with the estimates of all methods."""
    if not result.shots:
        print(result.no_shot_reason)
    camera, ball_radius_m = result.session.camera, result.session.ball_radius_m
    for shot in result.shots:
        velocity_m_s = shot.velocity_m_s(camera, ball_radius_m)
        speed = "" if velocity_m_s is None else f"{np.linalg.norm(velocity_m_s):.1f} m/s, "
        distance_m = np.mean(shot.positions_m(camera, ball_radius_m)[:, 2])
        print(f"shot from {shot.start_us} to {shot.end_us} us: {speed}{distance_m:.2f} m from the camera")
        for method, estimate in shot.estimates.items():
            if estimate.vector_rps is None:
                print(f"  {method:12} refused: {estimate.reason}")
                continue
            x, y, z = estimate.axis if estimate.axis is not None else (0.0, 0.0, 0.0)
            mark = "*" if method == shot.best else " "
            print(
                f" {mark}{method:12} {estimate.magnitude_rps:6.2f} ± {estimate.magnitude_std_rps:.2f} rps, "
                f"axis ({x:+.3f}, {y:+.3f}, {z:+.3f}) ± {estimate.axis_std_deg:.1f} degrees"
            )


def plot_track(shot: spinscope.Shot, figure_path: Path | None) -> None:
    """Draw the ball's centre in the image and its radius over time; into a file, or a window without one."""
    x_px, y_px, _, _, radius_px = shot.state.T
    figure, (image, radius) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
    image.plot(x_px, y_px, "o-", markersize=3)
    image.set(xlabel="x [px]", ylabel="y [px]", title="Centre", aspect="equal")
    image.invert_yaxis()  # y points down
    radius.errorbar(shot.t_us / 1000, radius_px, shot.std[:, 4], fmt="o-", markersize=3)
    radius.set(xlabel="time [ms]", ylabel="radius [px]", title="Radius, 1 sigma")
    if figure_path is None:
        plt.show()
    else:
        figure.savefig(figure_path)
    plt.close(figure)


def sweep_pad(session: spinscope.Session) -> None:
    """Print the spin for several pads; the ball is tracked once, only the stages below the logo run again."""
    before = session.parameters
    for pad_px in (0.0, 1.0, 2.5, 4.0, 6.0):
        session.parameters = before.with_values({"logo": {"pad_px": pad_px}})
        for shot in session.estimate("normal_flow").shots[:1]:
            estimate = shot.estimates["normal_flow"]
            answer = estimate.reason if estimate.vector_rps is None else f"{estimate.magnitude_rps:.2f} rps"
            print(f"  pad {pad_px:3.1f} px: {shot.logo_events} events of the logo, {answer}")
    session.parameters = before


def main() -> None:
    """Go through the steps one by one."""
    recording_path = Path(sys.argv[1]) if len(sys.argv) > 1 else SAMPLE
    figure_path = Path(sys.argv[2]) if len(sys.argv) > 2 else None

    # Decode a recording into NumPy columns.
    recording = spinscope.open_recording(recording_path)
    events = recording.read()
    on_share = np.mean(events.on)
    print(f"{recording}: {len(events)} events, {(events.t_us[-1] - events.t_us[0]) / 1000:.1f} ms, {on_share:.0%} ON")

    # Estimate the spin of every shot, by all methods; * marks the answer that the program trusts.
    result = spinscope.estimate(recording)
    print_result(result)
    if not result.shots:
        return
    plot_track(result.shots[0], figure_path)

    # Change one parameter.
    print("normal_flow against logo.pad_px:")
    sweep_pad(result.session)

    # State your own lens, or the numbers are those of an 8 mm lens: with twice the focal length the ball is twice as
    # far away, and its spin differs by a percent, because the directions in which the ball's surface is seen differ.
    print("taken for a recording with a 16 mm lens:")
    print_result(spinscope.estimate(recording, {"camera": {"focal_length_mm": 16.0}}, method="normal_flow"))

    # Look at one stage's results tick by tick: here the optical flow of the logo's events.
    for tick in list(result.session.ticks(targets=("flow",)))[:8]:
        ball = tick.track.reason or f"{len(tick.flow.events.t_us)} events with flow"
        print(f"  tick {tick.packet.index}, up to {tick.packet.end_us} us: {ball}")

    # Events of your own come in as columns, with the size of the sensor.
    columns = spinscope.EventBatch.checked(
        events.t_us,
        events.x_px,
        events.y_px,
        events.on,
        width_px=recording.width_px,
        height_px=recording.height_px,
    )
    sensor_px = (recording.width_px, recording.height_px)
    print(f"the same from memory: best = {spinscope.estimate(columns, sensor_px=sensor_px).shots[0].best}")


if __name__ == "__main__":
    main()
