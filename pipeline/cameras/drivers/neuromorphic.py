"""Cameras through `neuromorphic-drivers`: EVK4, EVK3 HD, SilkyEvCam, DAVIS346, DVXplorer, Lucid Triton."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
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

NAME = "neuromorphic"
TIMEOUT_S = 0.05  # of a read, after which a camera that sees nothing is asked for commands and its end
LIMITER_PERIOD_US = 200  # in which events are counted and dropped, as the maker's own software has it
INSTALL = "`uv sync --extra live` (or `pip install spinscope[live]`)"
# Vendor and product numbers of the devices that the library knows (its own rules, 0.18).
UDEV_RULES = (
    'SUBSYSTEM=="usb", ATTRS{idVendor}=="152a", ATTRS{idProduct}=="84[0-1]?", MODE="0666"',
    'SUBSYSTEM=="usb", ATTRS{idVendor}=="04b4", ATTRS{idProduct}=="00f[4-5]", MODE="0666"',
    'SUBSYSTEM=="usb", ATTRS{idVendor}=="31f7", ATTRS{idProduct}=="000[3-4]", MODE="0666"',
    'SUBSYSTEM=="usb", ATTRS{idVendor}=="1409", ATTRS{idProduct}=="8e00", MODE="0666"',
)
# The library's messages, and what to do.
REMEDIES = {
    "Access denied": "this user may not use the camera: run what `spinscope cameras --install-udev` prints",
    "already used by another program": "another program uses the camera: close it",
    "No such device": "the camera was unplugged: plug it in again",
    "Other error": "there is no access to USB on this machine",
    "no device found": "no camera is plugged in: `spinscope cameras` lists them",
    "another thread": "two threads read one camera, which is a fault of this program: please report it",
}


def library() -> Any:
    """The library, loaded when it is needed; raises DriverMissingError where it is not installed."""
    try:
        return import_module("neuromorphic_drivers")
    except ImportError as error:
        raise DriverMissingError(f"for EVK4, EVK3 HD, SilkyEvCam, DAVIS346, DVXplorer {INSTALL}") from error


def camera_error(error: Exception, what: str) -> CameraError:
    """The library's error in one line with its remedy."""
    text = " ".join(str(error).split())
    remedy = next((said for key, said in REMEDIES.items() if key.lower() in text.lower()), "")
    return CameraError(f"{what}: {remedy} ({text})" if remedy else f"{what}: {text}")


def cameras() -> list[ListedCamera]:
    """The cameras that are plugged in; raises CameraError."""
    found = library()
    try:
        listed = found.list_devices()
    except RuntimeError as error:
        raise camera_error(error, "cameras cannot be listed") from error
    return [_listed(found, one) for one in listed]


def _listed(found: Any, one: Any) -> ListedCamera:
    name, connection, serial = one.name.value, one.connection.value, one.serial or ""
    if one.error is not None:
        problem = str(camera_error(RuntimeError(one.error), name))
        return ListedCamera(NAME, name, serial, connection, problem=problem)
    try:
        with found.open(serial=one.serial, address=one.address, iterator_timeout=TIMEOUT_S) as device:
            size, temperature = device.properties(), None
            with suppress(AttributeError, RuntimeError):  # not every model has a thermometer
                temperature = float(device.temperature_celsius())
    except RuntimeError as error:
        return ListedCamera(NAME, name, serial, connection, problem=str(camera_error(error, name)))
    return ListedCamera(NAME, name, serial, connection, (int(size.width), int(size.height)), temperature)


class NeuromorphicCamera(EventCamera):
    """An open camera of the library.

    Parameters
    ----------
    serial : str, optional
        Which one; the only one by default.
    biases : Mapping of str to int
        Values that differ from the device's own.
    options : CameraOptions
        What the device leaves out by itself.
    """

    def __init__(self, serial: str | None, biases: Mapping[str, int], options: CameraOptions) -> None:
        self._library = library()
        try:
            self._device = self._library.open(serial=serial, iterator_timeout=TIMEOUT_S)
        except RuntimeError as error:
            raise camera_error(error, f"camera {serial}" if serial else "the camera") from error
        try:
            self._set_up(biases, options)
        except BaseException:
            self.close()
            raise

    def _set_up(self, biases: Mapping[str, int], options: CameraOptions) -> None:
        device, properties = self._device, self._device.properties()
        self.name, self.serial = str(device.name().value), str(device.serial())
        self.width_px, self.height_px = int(properties.width), int(properties.height)
        bounds = device.biases_bounds()
        self.bias_limits = {
            bound.name: (int(getattr(bounds, bound.name).minimum), int(getattr(bounds, bound.name).maximum))
            for bound in fields(bounds)
        }
        module = getattr(self._library, device.name().name.lower())
        self._configuration = self._limited(module, _configuration(module), options)
        own = self._configuration.biases
        self.biases = {name: int(getattr(own, name)) for name in self.bias_limits}
        check_biases(biases, self)
        self.options, self._dropped, self._end_us = options, 0, 0
        self._apply_biases({**self.biases, **biases})
        self.biases = {**self.biases, **biases}

    def _limited(self, module: Any, configuration: Any, options: CameraOptions) -> Any:
        """The configuration with region of interest and limit of the event rate; raises CameraError."""
        if options.roi_px is not None:
            x, y, width, height = options.roi_px
            check_region(options.roi_px, self.width_px, self.height_px)
            if hasattr(configuration, "region_of_interest"):
                configuration = replace(configuration, region_of_interest=module.RegionOfInterest(x, y, width, height))
            elif hasattr(module, "RowColumnMask"):
                mask = module.RowColumnMask(set=True)
                mask.clear_rectangle(x=x, y=self.height_px - y - height, width=width, height=height)  # rows from below
                configuration = replace(configuration, x_mask=mask.x_mask(), y_mask=mask.y_mask())
            else:
                raise CameraError(f"{self.name} has no region of interest: leave out --roi")
        if options.most_mev_s is not None:
            if not hasattr(configuration, "rate_limiter"):
                raise CameraError(f"{self.name} has no limit of its event rate: leave out --most-mev-s")
            most = max(round(options.most_mev_s * LIMITER_PERIOD_US), 1)
            limiter = module.RateLimiter(reference_period_us=LIMITER_PERIOD_US, maximum_events_per_period=most)
            configuration = replace(configuration, rate_limiter=limiter)
        return configuration

    def read(self) -> CameraPacket | None:
        """The next packet of the device; raises CameraError when it was unplugged or another thread holds it."""
        try:
            status, packet = next(self._device)
        except StopIteration:
            return None
        except RuntimeError as error:
            raise camera_error(error, f"{self.name} {self.serial}") from error
        dropped = 0
        if status.ring is not None:
            dropped, self._dropped = status.ring.dropped_packets - self._dropped, status.ring.dropped_packets
            self._end_us = int(status.ring.current_t)
        events = None if packet is None else packet.polarity_events
        if events is None or not len(events):
            return CameraPacket(EventBatch.empty(), self._end_us, max(dropped, 0))
        inside = (events["x"] < self.width_px) & (events["y"] < self.height_px)
        outside = int(np.count_nonzero(~inside))
        if outside:
            events = events[inside]
        batch = EventBatch(
            events["t"].astype(np.int64),
            np.ascontiguousarray(events["x"], np.uint16),
            np.ascontiguousarray(events["y"], np.uint16),
            np.ascontiguousarray(events["on"], np.bool_),
        )
        if len(batch):
            self._end_us = max(self._end_us, int(batch.t_us[-1]))
        return CameraPacket(batch, self._end_us, max(dropped, 0), outside)

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        self._configuration = replace(self._configuration, biases=replace(self._configuration.biases, **biases))
        try:
            self._device.update_configuration(self._configuration)
        except RuntimeError as error:
            raise camera_error(error, f"biases of {self.name} {self.serial}") from error

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()


def _configuration(module: Any) -> Any:
    """A device's configuration, as the library has it by default but for a readout that waits for no frames."""
    configuration = module.Configuration()
    if hasattr(configuration, "readout_frames_per_second"):  # else events of a DVXplorer come every 10 ms
        fastest = module.ReadoutFramesPerSecond.VARIABLE5000
        configuration = replace(configuration, readout_frames_per_second=fastest)
    return configuration


DRIVERS.register(
    CameraDriver(
        name=NAME,
        label="EVK4, EVK3 HD, SilkyEvCam, DAVIS346, DVXplorer, Lucid Triton (neuromorphic-drivers)",
        cameras=cameras,
        open=NeuromorphicCamera,
        udev_rules=UDEV_RULES,
    )
)
