"""Presets and the command line that gives the same numbers, without a server."""

from __future__ import annotations

import shlex
from pathlib import Path

from spinscope.app.web import presets
from spinscope.pipeline.registry import Parameters

OPENED = Parameters().with_assignments(
    ["track.ball=fixed", "track.fixed_x_px=40", "track.fixed_y_px=30", "track.fixed_radius_px=9", "ball.diameter_mm=38"]
)


def test_a_preset_keeps_the_set_up_that_it_does_not_name() -> None:
    applied = presets.applied("[logo]\npad_px = 4.0\n[ball]\ndiameter_mm = 40.5\n", OPENED)
    assert (applied.logo.pad_px, applied.ball.diameter_mm) == (4.0, 40.5)
    assert (applied.track.ball, applied.track.fixed_x_px, applied.track.fixed_radius_px) == ("fixed", 40.0, 9.0)


def test_what_differs_from_the_defaults_goes_out_and_comes_back() -> None:
    changed = OPENED.with_assignments(["logo.pad_px=4", "filter.mode=trail", "camera.up=0,-1,0"])
    assert presets.applied(presets.as_toml(changed), Parameters()) == changed


def test_the_command_line_is_one_that_a_shell_takes() -> None:
    """Also of a path with blanks; the window in its order."""
    path = Path("my recordings/a b.raw")
    changed = OPENED.with_assignments(["camera.up=0,-1,0"])
    words = shlex.split(presets.command(path, changed, (1000, 2500)))
    assert words[:3] == ["spinscope", "analyze", str(path)]
    assert words[-3:] == ["--window", "1000", "2500"]
    assignments = [words[at + 1] for at, word in enumerate(words) if word == "--set"]
    assert Parameters().with_assignments(assignments) == changed
    assert "--window" not in presets.command(path, changed, None)
