"""The driver of dv-processing against a fake of its interface (2.0): no camera is at hand."""

from __future__ import annotations

import sys
from datetime import timedelta
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.cameras import CameraOptions, open_camera
from spinscope.pipeline.errors import CameraError

DTYPE = np.dtype(
    {
        "names": ["timestamp", "x", "y", "polarity"],
        "formats": ["<i8", "<i2", "<i2", "i1"],
        "offsets": [0, 8, 10, 12],
        "itemsize": 16,
    }
)
OFFSET_US = 1_700_000_000_000_000  # of the camera's clock to the time of day
ERROR = "/project/discovery.hpp(88): open()\nRuntimeError: Could not open device\nStacktrace:\n 0# 0x00 in dv.so"


class Device:
    """A device of the fake library: gives what it is told, then it is unplugged."""

    def __init__(self, given: list[Any]) -> None:
        self._given, self.asked = iter(given), list[tuple[str, Any]]()
        self._is_running = True

    def getNextEventBatch(self) -> Any:
        one = next(self._given, "unplugged")
        if one == "unplugged":
            self._is_running = False
            return None
        if isinstance(one, Exception):
            raise one
        return one

    def isRunning(self) -> bool:
        return self._is_running

    def getEventResolution(self) -> tuple[int, int]:
        return 640, 480

    def getSerialNumber(self) -> str:
        return "DXM00123"

    def getCameraName(self) -> str:
        return "DVXplorer_M_DXM00123"

    def getTimestampOffset(self) -> timedelta:
        return timedelta(microseconds=OFFSET_US)

    def setTimeInterval(self, interval: timedelta) -> None:
        self.asked.append(("interval", interval))

    def setReadoutFPS(self, readout: str) -> None:
        self.asked.append(("readout", readout))

    def setCropArea(self, area: tuple[int, int, int, int]) -> None:
        self.asked.append(("area", area))


def batch(*rows: tuple[int, int, int, int]) -> Any:
    events = np.array([(OFFSET_US + t_us, *rest) for t_us, *rest in rows], DTYPE)
    return SimpleNamespace(numpy=lambda: events)


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The fake library, and none of the other driver's."""
    fake: Any = ModuleType("dv_processing")
    listed = SimpleNamespace(cameraModel=SimpleNamespace(name="DVXPLORER_M"), serialNumber="DXM00123")
    fake.device, fake.opened, fake.listed = Device([]), list[object](), [listed]

    def opening(*which: object) -> Device:
        fake.opened.append(which)
        if isinstance(fake.device, Exception):
            raise fake.device
        return fake.device  # type: ignore[no-any-return]

    readout = SimpleNamespace(VARIABLE_5000="VARIABLE_5000")
    camera = SimpleNamespace(discover=lambda: fake.listed, open=opening, DVXplorer=SimpleNamespace(ReadoutFPS=readout))
    fake.io = SimpleNamespace(camera=camera)
    monkeypatch.setitem(sys.modules, "dv_processing", fake)
    monkeypatch.setitem(sys.modules, "neuromorphic_drivers", None)
    return fake


def test_packets_time_outs_and_unplugging(library: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.cameras.drivers.inivation.TIMEOUT_S", 0.0)
    library.device = Device(
        [batch((990, 5, 6, 1), (1000, 639, 479, 0)), None, None, batch((1500, 640, 0, 1), (1600, -1, 0, 1))]
    )
    camera = open_camera()
    assert (camera.name, camera.serial, camera.width_px, camera.height_px) == ("DVXplorer_M", "DXM00123", 640, 480)
    first = camera.read()
    assert first is not None
    assert [column.tolist() for column in first.events.columns] == [[990, 1000], [5, 639], [6, 479], [True, False]]
    assert [column.dtype.str for column in first.events.columns] == ["<i8", "<u2", "<u2", "|b1"]
    nothing, last = camera.read(), None
    while last is None or not last.outside:
        last = camera.read()
    assert nothing is not None and (first.end_us, nothing.end_us, len(nothing.events)) == (1000, 1000, 0)
    assert last.outside == 2 and not len(last.events)
    with pytest.raises(CameraError, match="DVXplorer_M DXM00123: the camera was unplugged: plug it in again"):
        camera.read()


def test_it_hands_over_often_and_waits_for_no_frames(library: Any) -> None:
    open_camera("DXM00123", options=CameraOptions((10, 20, 300, 200)))
    assert library.opened == [("DXM00123",)]
    interval, readout = timedelta(milliseconds=1), "VARIABLE_5000"
    assert sorted(library.device.asked, key=str) == [
        ("area", (10, 20, 300, 200)),
        ("interval", interval),
        ("readout", readout),
    ]


@pytest.mark.parametrize(
    ("options", "biases", "said"),
    [
        (CameraOptions((600, 0, 50, 50)), {}, "outside the sensor of 640 x 480 px"),
        (CameraOptions(most_mev_s=1.0), {}, "no limit of its event rate"),
        (CameraOptions(), {"diff_on": 1}, "has no biases that could be set"),
    ],
)
def test_what_a_device_does_not_have(library: Any, options: CameraOptions, biases: dict[str, int], said: str) -> None:
    with pytest.raises(CameraError, match=said):
        open_camera(biases=biases, options=options)


def test_errors_are_one_line_with_the_remedy(library: Any) -> None:
    library.device = RuntimeError(ERROR)
    with pytest.raises(CameraError, match=r"\(Could not open device\): close other programs .*install-udev") as caught:
        open_camera("DXM00123")
    assert "\n" not in str(caught.value) and "Stacktrace" not in str(caught.value)
    with pytest.raises(CameraError, match="camera 7: no such camera of iniVation is plugged in"):
        open_camera("7")
    library.device = Device([RuntimeError(ERROR)])
    with pytest.raises(CameraError, match="DVXplorer_M DXM00123 cannot be used"):
        open_camera().read()


def test_listing(library: Any) -> None:
    listed = CliRunner().invoke(cli, ["cameras"])
    assert listed.output == "DXM00123  iniVation DVXPLORER_M, USB, 640 x 480 px\n"
    library.device = RuntimeError(ERROR)
    refused = CliRunner().invoke(cli, ["cameras"])
    assert "DXM00123  iniVation DVXPLORER_M, USB\n" in refused.output and "install-udev" in refused.stderr


def test_a_camera_that_both_drivers_know_is_listed_once(library: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    other: Any = ModuleType("neuromorphic_drivers")
    about = {"name": "iniVation DVXplorer", "connection": "USB 3"}
    other.list_devices = lambda: [
        SimpleNamespace(
            **{name: SimpleNamespace(value=value) for name, value in about.items()}, serial="DXM00123", error="busy"
        )
    ]
    monkeypatch.setitem(sys.modules, "neuromorphic_drivers", other)
    listed = CliRunner().invoke(cli, ["cameras"])
    assert listed.stdout == "DXM00123  iniVation DVXplorer, USB 3\n"


def test_without_a_driver_both_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("dv_processing", "neuromorphic_drivers"):
        monkeypatch.setitem(sys.modules, name, None)
    for arguments in (["cameras"], ["live", "--headless"]):
        said = str(CliRunner().invoke(cli, arguments).exception)
        assert "uv sync --extra live" in said and "uv sync --extra inivation" in said
    assert "--replay FILE" in said
