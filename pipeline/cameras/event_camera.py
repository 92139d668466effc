"""Interface of a running camera, and the registry of drivers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from ..errors import CameraError
from ..events import EventBatch
from ..extensions import Registry

UDEV_RULES = "/etc/udev/rules.d/65-event-cameras.rules"


@dataclass(frozen=True, slots=True, eq=False)
class CameraPacket:
    """Events that a camera hands over at once.

    Attributes
    ----------
    events : EventBatch
        In order of time, on the sensor; perhaps none.
    end_us : int
        All events before this time have come (the camera's clock).
    dropped : int
        Packets that driver or ring lost before this one.
    outside : int
        Events beyond the sensor, left out: the camera states a wrong size.
    """

    events: EventBatch
    end_us: int
    dropped: int = 0
    outside: int = 0


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """Events that a camera leaves out by itself, before they go over the cable.

    Attributes
    ----------
    roi_px : (int, int, int, int), optional
        Region of interest, x, y, width and height: no event comes from outside.
    most_mev_s : float, optional
        Millions of events a second, above which it drops some.
    """

    roi_px: tuple[int, int, int, int] | None = None
    most_mev_s: float | None = None


class DriverMissingError(CameraError):
    """A driver's library is not installed; the message says for which cameras how it is."""


class EventCamera(ABC):
    """An open camera. All methods are called by one thread, the one that reads.

    Attributes
    ----------
    name, serial : str
        Model and serial number, for people.
    width_px, height_px : int
        Size of the sensor.
    bias_limits : Mapping of str to (int, int)
        Lowest and highest value of each bias that can be set, as the device states them.
    biases : Mapping of str to int
        Present values, as far as they are known.
    without_biases : str
        Why no bias can be set, for people; empty where some can.
    options : CameraOptions
        What it leaves out by itself.
    is_replay : bool
        Whether its events are a recording's.
    can_wait : bool
        Whether it hands its events over whenever they are asked for, as no real camera does.
    """

    is_replay = False
    can_wait = False
    options = CameraOptions()
    name: str
    serial: str
    width_px: int
    height_px: int
    bias_limits: Mapping[str, tuple[int, int]]
    biases: Mapping[str, int]

    @property
    def without_biases(self) -> str:
        """Reason for which no bias can be set."""
        return "" if self.bias_limits else f"{self.name} has no biases that could be set"

    @abstractmethod
    def read(self) -> CameraPacket | None:
        """The next packet, after 50 ms at the latest, perhaps without events; None where no more come.

        Raises CameraError when the camera is gone; it can then be opened anew.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the camera."""

    def set_biases(self, biases: Mapping[str, int]) -> None:
        """Change some biases; raises CameraError for unknown ones and values beyond the device's limits."""
        check_biases(biases, self)
        self._apply_biases({**self.biases, **biases})
        self.biases = {**self.biases, **biases}

    @abstractmethod
    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        """Hand all values over to the device."""


def check_region(roi_px: tuple[int, int, int, int], width_px: int, height_px: int) -> None:
    """Raise CameraError for a region of interest beyond the sensor."""
    x, y, width, height = roi_px
    if not (0 <= x < x + width <= width_px and 0 <= y < y + height <= height_px):
        raise CameraError(
            f"region of interest {x} {y} {width} {height} lies outside the sensor of {width_px} x {height_px} px: give "
            "X Y WIDTH HEIGHT in pixels"
        )


def check_biases(biases: Mapping[str, int], camera: EventCamera) -> None:
    """Raise CameraError for biases that the device does not have or that cannot be set, and values out of range."""
    if biases and camera.without_biases:
        raise CameraError(camera.without_biases)
    for bias, value in biases.items():
        if bias not in camera.bias_limits:
            raise CameraError(f"{camera.name} has no bias {bias!r}: it has {', '.join(camera.bias_limits)}")
        low, high = camera.bias_limits[bias]
        if not low <= value <= high:
            raise CameraError(f"bias {bias} = {value} is out of range for {camera.name}: {low} to {high}")


@dataclass(frozen=True, slots=True)
class ListedCamera:
    """Camera that is plugged in.

    Attributes
    ----------
    driver, name, serial, connection : str
        Driver, model, serial number ("" where it cannot be read) and kind of connection.
    size_px : (int, int), optional
        Width and height; None where they cannot be read.
    temperature_deg_c : float, optional
        Of the sensor, where the device tells it.
    problem : str
        Why it cannot be opened, with the remedy; empty where it can.
    """

    driver: str
    name: str
    serial: str
    connection: str
    size_px: tuple[int, int] | None = None
    temperature_deg_c: float | None = None
    problem: str = ""


@dataclass(frozen=True, kw_only=True)
class CameraDriver:
    """Driver of one family of cameras.

    Attributes
    ----------
    name, label : str
        As users type it, and for people.
    cameras : callable
        `cameras() -> list of ListedCamera`: what is plugged in; raises DriverMissingError when the driver is not
        installed, and CameraError.
    open : callable
        `open(serial or None, biases, options) -> EventCamera`; raises CameraError, also for an option that the device
        does not have.
    udev_rules : tuple of str
        Lines that let everybody use its cameras on Linux, where no other driver's do.
    """

    name: str
    label: str
    cameras: Callable[[], list[ListedCamera]]
    open: Callable[[str | None, Mapping[str, int], CameraOptions], EventCamera]
    udev_rules: tuple[str, ...] = field(default=())


DRIVERS: Registry[CameraDriver] = Registry("camera driver")


def open_camera(
    serial: str | None = None,
    biases: Mapping[str, int] | None = None,
    options: CameraOptions = CameraOptions(),
) -> EventCamera:
    """Open the camera of this serial number, or the only one there is; raises CameraError with the remedy."""
    problems, missing = list[str](), list[str]()
    for driver in DRIVERS:
        try:
            return driver.open(serial, biases or {}, options)
        except DriverMissingError as error:
            missing.append(str(error))
        except CameraError as error:
            problems.append(str(error))
    said = "; ".join(problems) or _without_driver(missing)
    raise CameraError(f"{said}; without a camera there are --replay FILE and --simulate")


def listed_cameras() -> list[ListedCamera]:
    """The cameras that are plugged in, each by the first driver that knows it; raises CameraError without a driver."""
    found, problems, missing = list[ListedCamera](), list[str](), list[str]()
    for driver in DRIVERS:
        known = {one.serial for one in found if one.serial}
        try:
            found += (one for one in driver.cameras() if one.serial not in known)
        except DriverMissingError as error:
            missing.append(str(error))
        except CameraError as error:
            problems.append(str(error))
    if problems and not found:
        raise CameraError("; ".join(problems))
    if len(missing) == len(DRIVERS):
        raise CameraError(_without_driver(missing))
    return found


def _without_driver(missing: Sequence[str]) -> str:
    return f"no driver of a camera is installed: {', '.join(missing)}"


def udev_instructions() -> str:
    """Commands that let everybody on this machine use the cameras (Linux), for people to run."""
    rules = "\n".join(rule for driver in DRIVERS for rule in driver.udev_rules)
    return (
        f"sudo tee {UDEV_RULES} <<'RULES'\n{rules}\nRULES\n"
        "sudo udevadm control --reload-rules && sudo udevadm trigger\n"
    )
