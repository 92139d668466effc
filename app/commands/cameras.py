"""`spinscope cameras`: what is plugged in."""

from __future__ import annotations

import click

from spinscope.pipeline.cameras.event_camera import listed_cameras, udev_instructions

from ..terminal import note


@click.command()
@click.option("--install-udev", is_flag=True, help="Print the commands that let every user of this machine use them.")
def cameras(install_udev: bool) -> None:
    """List the cameras that are plugged in, with serial number, sensor and temperature."""
    if install_udev:
        print(udev_instructions(), end="")
        return
    found = listed_cameras()
    for one in found:
        size = "" if one.size_px is None else f", {one.size_px[0]} x {one.size_px[1]} px"
        warm = "" if one.temperature_deg_c is None else f", {one.temperature_deg_c:.0f} degrees C"
        print(f"{one.serial or '-'}  {one.name}, {one.connection}{size}{warm}")
        if one.problem:
            note(one.problem)
    if not found:
        note("no camera is plugged in, or this user may not see it (`spinscope cameras --install-udev`)")
