"""Cameras of iniVation through `dv-processing`: DVXplorer Mini and Micro, DVXplorer, DAVIS, DVS128.

The library tells neither the limits of biases nor lost packets: no bias can be set here, none is counted as lost.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from datetime import timedelta
from importlib import import_module
from typing import Any

import numpy as np

from ...errors import CameraError
from ...events import EventBatch
from ..event_camera import (
    DRIVERS,
    CameraDriver,
    CameraOptions,
    CameraPacket,
    DriverMissingError,
    EventCamera,
    ListedCamera,
    check_biases,
    check_region,
)

NAME = "inivation"
TIMEOUT_S, POLL_S = 0.05, 0.0005  # of a read, and between two looks whether events have come
PACKET = timedelta(milliseconds=1)  # the library hands over every 10 ms by default
MICROSECOND = timedelta(microseconds=1)
INSTALL = "`uv sync --extra inivation` (or `pip install spinscope[inivation]`)"


def library() -> Any:
    """The library, loaded when it is needed; raises DriverMissingError where it is not installed."""
    try:
        return import_module("dv_processing")
    except ImportError as error:
        raise DriverMissingError(f"for iniVation's cameras {INSTALL}") from error


def camera_error(error: Exception, what: str) -> CameraError:
    """The library's error in one line: its message without file, line and stack."""
    lines = str(error).splitlines() or [type(error).__name__]
    message = next((line for line in lines if line.startswith("RuntimeError: ")), lines[0])
    return CameraError(
        f"{what} cannot be used ({message.removeprefix('RuntimeError: ')}): close other programs that use it, and see "
        "`spinscope cameras --install-udev`"
    )


def cameras() -> list[ListedCamera]:
    """The cameras that are plugged in; raises CameraError."""
    found = library()
    try:
        listed = found.io.camera.discover()
    except (RuntimeError, IndexError) as error:
        raise camera_error(error, "the list of cameras") from error
    return [_listed(found, one) for one in listed]


def _listed(found: Any, one: Any) -> ListedCamera:
    name, serial = f"iniVation {one.cameraModel.name}", str(one.serialNumber)
    try:
        camera = found.io.camera.open(one)
        size_px = camera.getEventResolution()
    except (RuntimeError, IndexError) as error:
        return ListedCamera(NAME, name, serial, "USB", problem=str(camera_error(error, name)))
    return ListedCamera(NAME, name, serial, "USB", size_px)


class InivationCamera(EventCamera):
    """An open camera of the library.

    Parameters
    ----------
    serial : str, optional
        Which one; the only one by default.
    biases : Mapping of str to int
        None that could be set.
    options : CameraOptions
        What the device leaves out by itself.
    """

    def __init__(self, serial: str | None, biases: Mapping[str, int], options: CameraOptions) -> None:
        io = library().io.camera
        what = f"camera {serial}" if serial else "the camera"
        if not any(serial in (None, one.serialNumber) for one in io.discover()):
            raise CameraError(f"{what}: no such camera of iniVation is plugged in: `spinscope cameras` lists them")
        try:
            self._camera = io.open() if serial is None else io.open(serial)
            self._set_up(io, biases, options)
        except (RuntimeError, IndexError) as error:
            raise camera_error(error, what) from error

    def _set_up(self, io: Any, biases: Mapping[str, int], options: CameraOptions) -> None:
        camera = self._camera
        self.serial = str(camera.getSerialNumber())
        self.name = str(camera.getCameraName()).removesuffix(f"_{self.serial}")
        self.width_px, self.height_px = camera.getEventResolution()
        self.bias_limits, self.biases, self.options = {}, {}, options
        check_biases(biases, self)
        if options.most_mev_s is not None:
            raise CameraError(f"{self.name} has no limit of its event rate: leave out --most-mev-s")
        if options.roi_px is not None:
            check_region(options.roi_px, self.width_px, self.height_px)
            camera.setCropArea(options.roi_px)
        camera.setTimeInterval(PACKET)
        if hasattr(camera, "setReadoutFPS"):  # not by frames of a constant rate
            camera.setReadoutFPS(io.DVXplorer.ReadoutFPS.VARIABLE_5000)
        if hasattr(camera, "setFramesRunning"):  # of a DAVIS: nobody looks at them
            camera.setFramesRunning(False)
        self._offset_us = camera.getTimestampOffset() // MICROSECOND  # to the time of day
        self._end_us = 0

    def read(self) -> CameraPacket | None:
        """The next batch of the device; raises CameraError when it was unplugged."""
        due_s = time.monotonic() + TIMEOUT_S
        try:
            while (batch := self._camera.getNextEventBatch()) is None:
                if not self._camera.isRunning():
                    raise CameraError(f"{self.name} {self.serial}: the camera was unplugged: plug it in again")
                if time.monotonic() > due_s:
                    return CameraPacket(EventBatch.empty(), self._end_us)
                time.sleep(POLL_S)
            events = batch.numpy()
        except RuntimeError as error:
            raise camera_error(error, f"{self.name} {self.serial}") from error
        inside = (events["x"] >= 0) & (events["x"] < self.width_px)
        inside &= (events["y"] >= 0) & (events["y"] < self.height_px)
        outside = int(np.count_nonzero(~inside))
        if outside:
            events = events[inside]
        made = EventBatch(
            events["timestamp"].astype(np.int64) - self._offset_us,
            np.ascontiguousarray(events["x"], np.uint16),
            np.ascontiguousarray(events["y"], np.uint16),
            np.ascontiguousarray(events["polarity"] > 0),
        )
        if len(made):
            self._end_us = int(made.t_us[-1])
        return CameraPacket(made, self._end_us, outside=outside)

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        """There are none."""

    def close(self) -> None:
        """Let go of the device, which the library closes with its last use."""
        self._camera = None


DRIVERS.register(
    CameraDriver(
        name=NAME,
        label="DVXplorer Mini and Micro, DVXplorer, DAVIS, DVS128 (dv-processing)",
        cameras=cameras,
        open=InivationCamera,
    )
)
