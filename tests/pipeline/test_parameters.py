"""Parameters: one declaration, checked everywhere the same."""

from __future__ import annotations

import math

import pytest

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.registry import Parameters

DEFAULT = Parameters()


def test_assignments_reach_every_kind() -> None:
    changed = DEFAULT.with_assignments(
        [
            "logo.pad_px=3.5",
            "filter.mode=trail",
            "track.tick_us=1000",
            "camera.principal_x_px=600",
            "camera.up=0,1,0",
        ]
    )
    assert changed.logo.pad_px == 3.5
    assert changed.filter.mode == "trail"
    assert changed.track.tick_us == 1000
    assert changed.camera.principal_x_px == 600.0
    assert changed.camera.up == (0.0, 1.0, 0.0)
    for word in ("auto", "none"):
        assert changed.with_assignments([f"camera.principal_x_px={word}"]).camera.principal_x_px is None
    assert DEFAULT.logo.pad_px != 3.5


def test_the_last_of_two_assignments_wins() -> None:
    assert DEFAULT.with_assignments(["logo.pad_px=1", "logo.pad_px=2"]).logo.pad_px == 2.0


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("logo.pad_px=-1", "0 to 100 px"),
        ("track.tick_us=199", "200 to 100000 us"),
        ("track.tick_us=100001", "200 to 100000 us"),
        ("camera.up=0,0,-1.5", "-1 to 1"),
        ("logo.pad_px=nan", "not a number"),
        ("logo.pad_px=inf", "not a number"),
        ("logo.pad_px=true", "not a number"),
        ("logo.pad_px=", "not a number"),
        ("logo.pad=3", "did you mean pad_px"),
        ("lego.pad_px=3", "did you mean logo"),
        ("filter.mode=STC", "off, stc, trail, stc_cut_trail"),
        ("track.tick_us=1000.5", "not a whole number"),
        ("camera.up=0,1", "list of 3 numbers"),
        ("camera.up=0,1,x", "not a number"),
        ("pad_px=3", "stage.field=value"),
        ("logo.pad_px", "stage.field=value"),
        ("", "stage.field=value"),
    ],
)
def test_wrong_assignments_say_what_is_allowed(assignment: str, says: str) -> None:
    with pytest.raises(ParameterError) as raised:
        DEFAULT.with_assignments([assignment])
    assert says in str(raised.value)
    assert "\n" not in str(raised.value)


def test_every_parameter_is_declared_whole() -> None:
    for stage, fields in DEFAULT.as_dict().items():
        for name in fields:
            declared = DEFAULT.group(stage).tunables()[name]
            assert declared.help, f"{stage}.{name}"
            if declared.kind in ("number", "whole number"):
                assert declared.low is not None, f"{stage}.{name}"
                assert declared.high is not None, f"{stage}.{name}"
                assert declared.step, f"{stage}.{name}"
                suffix = name.rpartition("_")[2]
                if suffix in ("us", "px", "mm", "um", "rps", "hz", "deg"):
                    assert declared.unit.lower().replace("°", "deg") == suffix, f"{stage}.{name}"


def test_as_dict_is_accepted_back_and_equal_by_value() -> None:
    again = Parameters().with_values(DEFAULT.as_dict())
    assert again == DEFAULT
    assert hash(again) == hash(DEFAULT)


def test_nan_is_refused_from_a_table_too() -> None:
    with pytest.raises(ParameterError, match="not a number"):
        DEFAULT.with_values({"logo": {"pad_px": math.nan}})
    with pytest.raises(ParameterError, match="table"):
        DEFAULT.with_values({"logo": 3})


def test_the_bounds_themselves_are_allowed() -> None:
    for group, fields in DEFAULT.as_dict().items():
        for name in fields:
            declared = DEFAULT.group(group).tunables()[name]
            if declared.kind in ("number", "whole number"):
                for bound in (declared.low, declared.high):
                    assert DEFAULT.with_values({group: {name: bound}}).value(f"{group}.{name}") == bound


def test_former_names_are_read_with_a_notice() -> None:
    notices: list[str] = []
    changed = DEFAULT.with_values({"contrast": {"weakest": 0.4}}, notices.append)
    assert changed.contrast.min_gain == 0.4
    assert notices == ["contrast.weakest is now called contrast.min_gain"]
    assert DEFAULT.with_assignments(["contrast.weakest=0.5"]).contrast.min_gain == 0.5
