"""The driver of neuromorphic-drivers against a fake of its interface (0.18): no camera is at hand."""

from __future__ import annotations

import dataclasses
import enum
import sys
import threading
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.cameras import CameraOptions, open_camera
from spinscope.pipeline.errors import CameraError

DTYPE = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])


class Name(enum.Enum):
    PROPHESEE_EVK4 = "Prophesee EVK4"
    INIVATION_DVXPLORER = "iniVation DVXplorer"


@dataclasses.dataclass
class Biases:
    diff_on: int = 0
    diff_off: int = 0


@dataclasses.dataclass
class RateLimiter:
    reference_period_us: int
    maximum_events_per_period: int


class RowColumnMask:
    """The fake library's mask of rows and columns, rows from below."""

    def __init__(self, set: bool) -> None:
        self.is_left_out = np.full((720, 1280), set)

    def clear_rectangle(self, x: int, y: int, width: int, height: int) -> None:
        self.is_left_out[::-1][y : y + height, x : x + width] = False

    def x_mask(self) -> list[int]:
        return np.flatnonzero(~self.is_left_out.all(axis=0)).tolist()

    def y_mask(self) -> list[int]:
        return np.flatnonzero(~self.is_left_out.all(axis=1)).tolist()


@dataclasses.dataclass
class Evk4Configuration:
    biases: Biases = dataclasses.field(default_factory=Biases)
    x_mask: Any = ()
    y_mask: Any = ()
    rate_limiter: RateLimiter | None = None


class Readout(enum.Enum):
    CONSTANT100 = 0
    VARIABLE5000 = 8


@dataclasses.dataclass
class DvxplorerConfiguration:
    biases: Biases = dataclasses.field(default_factory=Biases)
    readout_frames_per_second: Readout = Readout.CONSTANT100


@dataclasses.dataclass(frozen=True)
class Bounds:
    minimum: int
    maximum: int


@dataclasses.dataclass(frozen=True)
class BiasesBounds:
    diff_on: Bounds = Bounds(-85, 140)
    diff_off: Bounds = Bounds(-35, 190)


class Device:
    """A device of the fake library: gives what it is told, and minds which thread calls."""

    def __init__(self, given: list[Any], name: Name = Name.PROPHESEE_EVK4) -> None:
        self._given, self._name = iter(given), name
        self.configurations: list[Any] = []
        self.closed = False
        self._thread: int | None = None

    def _one_thread(self) -> None:
        self._thread = self._thread or threading.get_ident()
        if self._thread != threading.get_ident():
            raise RuntimeError("the device is used by another thread")

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __next__(self) -> Any:
        self._one_thread()
        one = next(self._given)
        if isinstance(one, Exception):
            raise one
        return one

    def update_configuration(self, configuration: Any) -> None:
        self._one_thread()
        self.configurations.append(configuration)

    def name(self) -> Name:
        return self._name

    def serial(self) -> str:
        return "00051195"

    def properties(self) -> Any:
        return SimpleNamespace(width=1280, height=720)

    def biases_bounds(self) -> BiasesBounds:
        return BiasesBounds()

    def temperature_celsius(self) -> float:
        return 41.0

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Any:
    fake = ModuleType("neuromorphic_drivers")
    connection = SimpleNamespace(value="USB 3.0 SuperSpeed (5.0 Gb/s)")
    listed = SimpleNamespace(
        name=Name.PROPHESEE_EVK4, connection=connection, address="2:3", serial="00051195", error=None
    )
    fake.device, fake.opened = Device([]), []  # type: ignore[attr-defined]
    fake.prophesee_evk4 = SimpleNamespace(  # type: ignore[attr-defined]
        Configuration=Evk4Configuration, RowColumnMask=RowColumnMask, RateLimiter=RateLimiter
    )
    fake.inivation_dvxplorer = SimpleNamespace(  # type: ignore[attr-defined]
        Configuration=DvxplorerConfiguration, ReadoutFramesPerSecond=Readout
    )
    fake.list_devices = lambda: [listed]  # type: ignore[attr-defined]

    def opening(**options: Any) -> Device:
        if isinstance(fake.device, Exception):
            raise fake.device
        fake.opened.append(options)
        return fake.device  # type: ignore[no-any-return]

    fake.open = opening  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "neuromorphic_drivers", fake)
    return fake


def status(current_t: int, dropped: int = 0) -> Any:
    return SimpleNamespace(ring=SimpleNamespace(current_t=current_t, dropped_packets=dropped))


def packet(*rows: tuple[int, int, int, bool]) -> Any:
    return SimpleNamespace(polarity_events=np.array(list(rows), DTYPE))


def test_packets_time_outs_and_counts(library: Any) -> None:
    library.device = Device(
        [
            (status(1000), packet((990, 5, 6, True), (1000, 1279, 719, False))),
            (SimpleNamespace(ring=None), None),
            (status(3000, dropped=3), SimpleNamespace(polarity_events=None)),
            (status(2500, dropped=4), packet((3100, 1280, 0, True), (3150, 0, 720, True), (3200, 0, 0, True))),
        ]
    )
    camera = open_camera()
    first, nothing, empty, last = (camera.read() for _ in range(4))
    assert first is not None and nothing is not None and empty is not None and last is not None
    assert [column.tolist() for column in first.events.columns] == [[990, 1000], [5, 1279], [6, 719], [True, False]]
    assert [column.dtype.str for column in first.events.columns] == ["<i8", "<u2", "<u2", "|b1"]
    assert [one.end_us for one in (first, nothing, empty, last)] == [1000, 1000, 3000, 3200]
    assert [one.dropped for one in (first, nothing, empty, last)] == [0, 0, 3, 1]
    assert last.outside == 2 and last.events.t_us.tolist() == [3200]
    assert camera.read() is None


def test_biases_have_the_device_s_limits(library: Any) -> None:
    camera = open_camera(biases={"diff_on": 40})
    assert camera.bias_limits == {"diff_on": (-85, 140), "diff_off": (-35, 190)}
    camera.set_biases({"diff_off": 30})
    assert [vars(one.biases) for one in library.device.configurations] == [
        {"diff_on": 40, "diff_off": 0},
        {"diff_on": 40, "diff_off": 30},
    ]
    with pytest.raises(CameraError, match="bias diff_on = 141 is out of range for Prophesee EVK4: -85 to 140"):
        camera.set_biases({"diff_on": 141})
    with pytest.raises(CameraError, match="has no bias 'pr': it has diff_on, diff_off"):
        camera.set_biases({"pr": 1})
    assert camera.biases == {"diff_on": 40, "diff_off": 30}


def test_a_wrong_bias_at_the_start_closes_the_device(library: Any) -> None:
    with pytest.raises(CameraError, match="out of range"):
        open_camera(biases={"diff_on": 1000})
    assert library.device.closed


def test_a_dvxplorer_does_not_wait_for_frames(library: Any) -> None:
    library.device = Device([], Name.INIVATION_DVXPLORER)
    open_camera()
    assert library.device.configurations[0].readout_frames_per_second is Readout.VARIABLE5000


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("Access denied (insufficient permissions)", "cameras --install-udev"),
        ("the device is already used by another program", "another program uses the camera: close it"),
        ("No such device (it may have been disconnected)", "was unplugged"),
        ("Other error", "no access to USB"),
    ],
)
def test_errors_say_the_remedy_in_one_line(library: Any, said: str, remedy: str) -> None:
    library.device = RuntimeError(said)
    with pytest.raises(CameraError, match=remedy) as caught:
        open_camera("00051195")
    assert "camera 00051195" in str(caught.value) and "\n" not in str(caught.value)


def test_unplugging_while_it_runs(library: Any) -> None:
    library.device = Device([RuntimeError("No such device (it may have been disconnected)")])
    with pytest.raises(CameraError, match="Prophesee EVK4 00051195: the camera was unplugged: plug it in again"):
        open_camera().read()


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "neuromorphic_drivers", None)
    with pytest.raises(CameraError, match="uv sync --extra live"):
        open_camera()


def test_listing(library: Any) -> None:
    result = CliRunner().invoke(cli, ["cameras"])
    assert result.output == "00051195  Prophesee EVK4, USB 3.0 SuperSpeed (5.0 Gb/s), 1280 x 720 px, 41 degrees C\n"
    library.device = RuntimeError("Access denied")
    result = CliRunner().invoke(cli, ["cameras"])
    assert "install-udev" in result.stderr


def test_udev_instructions() -> None:
    result = CliRunner().invoke(cli, ["cameras", "--install-udev"])
    assert 'ATTRS{idVendor}=="04b4", ATTRS{idProduct}=="00f[4-5]"' in result.output
    assert "udevadm control --reload-rules" in result.output


def test_region_of_interest_and_limit_of_the_event_rate(library: Any) -> None:
    open_camera(options=CameraOptions((10, 20, 3, 2), 5.0))
    configuration = library.device.configurations[-1]
    assert (configuration.x_mask, configuration.y_mask) == ([10, 11, 12], [20, 21])
    limiter = configuration.rate_limiter
    assert limiter.maximum_events_per_period / limiter.reference_period_us == 5.0


@pytest.mark.parametrize(
    ("options", "name", "said"),
    [
        (CameraOptions((1270, 0, 20, 20)), Name.PROPHESEE_EVK4, "outside the sensor of 1280 x 720 px"),
        (CameraOptions((0, 0, 20, 20)), Name.INIVATION_DVXPLORER, "no region of interest"),
        (CameraOptions(most_mev_s=1.0), Name.INIVATION_DVXPLORER, "no limit of its event rate"),
    ],
)
def test_options_that_a_device_does_not_have(library: Any, options: CameraOptions, name: Name, said: str) -> None:
    library.device = Device([], name)
    with pytest.raises(CameraError, match=said):
        open_camera(options=options)
    assert library.device.closed
