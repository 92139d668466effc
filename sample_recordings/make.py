"""Make Spinscope's own sample recordings anew: `uv run python sample_recordings/make.py [FOLDER]`.

The same versions of Spinscope and its libraries give the same events, bit for bit. Each of them is what
`spinscope simulate KIND` writes with these options, or a scene of `real_scenes.KINDS`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from spinscope.app.terminal import ProgressBar, note
from spinscope.pipeline.biases import read_biases
from spinscope.pipeline.simulated_recordings import WrittenSimulation, simulate_to_file, write_simulation
from spinscope.pipeline.simulator.real_scenes import KINDS, real_scene

FOLDER = Path(__file__).parent / "own"

# A shot at two settings of the camera: everything else, seed included, is the same.
TWICE: dict[str, Any] = {"spin": "top", "magnitude_rps": 45.0, "speed_m_s": 7.5, "ball": 6, "seed": 1104}
# Half the image each way keeps 20 seconds small: a shorter flight, a quarter of the background noise.
HALF: dict[str, Any] = {"width_px": 640, "height_px": 360}

# File name -> (kind, options).
SAMPLES: dict[str, tuple[str, dict[str, Any]]] = {
    "spinner_top": ("spinner", {"spin": "top", "ball": 1, "magnitude_rps": 50.0, "seed": 1101}),
    "spinner_back": ("spinner", {"spin": "back", "ball": 3, "magnitude_rps": 30.0, "seed": 1102}),
    "spinner_side": ("spinner", {"spin": "side", "ball": 2, "magnitude_rps": 40.0, "seed": 1103}),
    "spinner_ball5": ("spinner", {"spin": "top", "ball": 5, "magnitude_rps": 50.0, "seed": 1105}),
    "shot_slow_top": ("flight", {"spin": "top", "magnitude_rps": 25.0, "speed_m_s": 4.0, "ball": 1, "seed": 1106}),
    "shot_fast_back": ("flight", {"spin": "back", "magnitude_rps": 60.0, "speed_m_s": 9.0, "ball": 4, "seed": 1107}),
    "shot_mixed_two_balls": (
        "flight",
        {"spin": "mixed", "magnitude_rps": 55.0, "speed_m_s": 7.0, "second_ball": True, "seed": 1108},
    ),
    "shot_paper_biases": ("flight", {**TWICE, "biases": read_biases(FOLDER / "paper.bias")}),
    "shot_factory_biases": ("flight", {**TWICE, "biases": read_biases(FOLDER / "factory.bias")}),
    "bounce": ("bounce", {"seed": 1122}),
    "two_balls": ("relay", {"seed": 1112}),
    "shot_hidden_side": (
        "flight",
        {"spin": "left", "magnitude_rps": 35.0, "speed_m_s": 6.0, "heading_deg": 80.0, "seed": 1137},
    ),
    "rally": ("rally", {**HALF, "shots": 6, "duration_ms": 20_000.0, "seed": 1109}),
}


def make(name: str, folder: Path) -> WrittenSimulation:
    """Simulate one sample into a folder; raises SpinscopeError."""
    kind, options = SAMPLES[name]
    with ProgressBar() as bar:
        if kind in KINDS:
            return write_simulation(real_scene(kind, options["seed"]).simulate(bar), folder / f"{name}.h5")
        return simulate_to_file(kind, folder / f"{name}.h5", on_progress=bar, **options)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for sample in SAMPLES:
        written = make(sample, target)
        made = written.recording
        counts = f"{len(made.events):,} events, {made.logo_events:,} of the logo"
        note(f"{written.path}: {counts}, {made.duration_us / 1e3:.0f} ms")
