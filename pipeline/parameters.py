"""Parameters declared once: the declaration feeds validation, sliders, `--set`, presets and the docs.

A stage's parameters are one frozen, keyword-only dataclass whose fields are made by `tunable` (a number),
`switch` (yes or no) or `choice` (one of several words).
"""

from __future__ import annotations

import dataclasses
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from .errors import ParameterError
from .extensions import did_you_mean

Group = TypeVar("Group", bound="ParameterGroup")


@dataclass(frozen=True, slots=True)
class Tunable:
    """Declaration of one parameter: default, range, unit, choices and help."""

    default: Any
    help: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    step: float | None = None
    choices: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """number, whole number, switch, choice, or numbers (a fixed-length list of numbers).

        A number whose default is None may be left out ("auto"): the program then finds it itself.
        """
        if self.choices:
            return "choice"
        if isinstance(self.default, bool):
            return "switch"
        if isinstance(self.default, tuple):
            return "numbers"
        return "whole number" if isinstance(self.default, int) else "number"

    def checked(self, name: str, value: Any) -> Any:
        """The value in the declared type; raises ParameterError that says what is allowed."""
        if isinstance(value, str) and self.kind != "choice":
            value = _parsed(value)
        kind = self.kind
        if self.default is None and value is None:
            return None
        if kind == "choice":
            if value not in self.choices:
                raise ParameterError(f"{name} = {value!r:.80} is none of {', '.join(self.choices)}")
            return value
        if kind == "switch":
            if not isinstance(value, bool):
                raise ParameterError(f"{name} = {value!r:.80} is not a switch: use true or false")
            return value
        if kind == "numbers":
            if not isinstance(value, (list, tuple)) or len(value) != len(self.default):
                raise ParameterError(f"{name} = {value!r:.80} is not a list of {len(self.default)} numbers")
            return tuple(self._number(name, item) for item in value)
        number = self._number(name, value)
        if kind == "whole number":
            if number != int(number):
                raise ParameterError(f"{name} = {value!r:.80} is not a whole number")
            return int(number)
        return number

    def _number(self, name: str, value: Any) -> float:
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise ParameterError(f"{name} is too large a number: {self.allowed}")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ParameterError(f"{name} = {value!r:.80} is not a number: {self.allowed}")
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if not low <= value <= high:
            raise ParameterError(f"{name} = {value:g} is out of range: {self.allowed}")
        return float(value)

    @property
    def allowed(self) -> str:
        """Allowed values, in words."""
        if self.kind == "choice":
            return f"one of {', '.join(self.choices)}"
        if self.kind == "switch":
            return "true or false"
        unit = f" {self.unit}" if self.unit else ""
        if self.low is None and self.high is None:
            return f"any number{unit}"
        if self.high is None:
            return f"{self.low:g}{unit} or more"
        if self.low is None:
            return f"{self.high:g}{unit} or less"
        return f"{self.low:g} to {self.high:g}{unit}"


def tunable(
    default: float | tuple[float, ...] | None,
    low: float | None,
    high: float | None,
    step: float | None,
    unit: str,
    help: str,
) -> Any:
    """Declare a number (int default = whole number, tuple default = that many numbers) with range and unit."""
    return _field(Tunable(default, help, unit, low, high, step))


def switch(default: bool, help: str) -> Any:
    """Declare a parameter that is on or off."""
    return _field(Tunable(default, help))


def choice(default: str, choices: Sequence[str], help: str) -> Any:
    """Declare a parameter that is one of several words."""
    return _field(Tunable(default, help, choices=tuple(choices)))


def _field(declared: Tunable) -> Any:
    return dataclasses.field(default=declared.default, metadata={"tunable": declared})


@dataclass(frozen=True, kw_only=True)
class ParameterGroup:
    """Base of one stage's parameters; checks every field when made. Compared and hashed by value.

    Attributes
    ----------
    renamed : dict of str to str
        Former names of fields and the present ones: presets and links of earlier versions are still read.
    """

    renamed: ClassVar[dict[str, str]] = {}

    def __post_init__(self) -> None:
        for name, declared in self.tunables().items():
            value = declared.checked(f"{self.group_name()}.{name}", getattr(self, name))
            object.__setattr__(self, name, value)

    @classmethod
    def group_name(cls) -> str:
        """The stage's name in `stage.field`, from the class name: FilterParameters -> filter."""
        return cls.__name__.removesuffix("Parameters").lower()

    @classmethod
    def tunables(cls) -> dict[str, Tunable]:
        """Every field's declaration, in order."""
        return {field.name: field.metadata["tunable"] for field in dataclasses.fields(cls)}

    def with_values(self: Group, values: Mapping[str, Any], on_rename: Callable[[str], None] | None = None) -> Group:
        """A copy with some fields changed; see `ParameterSet.with_values`."""
        known, changed = self.tunables(), {}
        for name, value in values.items():
            new_name = self.renamed.get(name, name)
            if new_name not in known:
                raise ParameterError(f"{self.group_name()}.{name:.80} is unknown{did_you_mean(name, known)}")
            if new_name != name and on_rename is not None:
                on_rename(f"{self.group_name()}.{name} is now called {self.group_name()}.{new_name}")
            changed[new_name] = value
        return dataclasses.replace(self, **changed)

    def as_dict(self) -> dict[str, Any]:
        """Field names and values, ready for JSON or TOML (tuples as lists)."""
        return {
            name: list(value) if isinstance(value := getattr(self, name), tuple) else value for name in self.tunables()
        }


class ParameterSet(ABC):
    """Immutable base of a whole program's parameters: one ParameterGroup for each name of `group_types`.

    Groups are attributes: `parameters.track.tick_us`. Compared and hashed by value.
    """

    def __init__(self, **groups: ParameterGroup) -> None:
        for name in groups:
            self._type_of(name)
        self._groups = {name: groups.get(name) or made() for name, made in self.group_types().items()}

    @classmethod
    @abstractmethod
    def group_types(cls) -> dict[str, type[ParameterGroup]]:
        """Class of each group by name, in the order in which people see them."""

    @classmethod
    def renamed(cls) -> dict[str, str]:
        """Present `group.field` of every former one."""
        groups = cls.group_types().items()
        return {f"{name}.{old}": f"{name}.{new}" for name, group in groups for old, new in group.renamed.items()}

    @classmethod
    def _type_of(cls, name: str) -> type[ParameterGroup]:
        types = cls.group_types()
        if name not in types:
            raise ParameterError(f"there is no stage {name!r:.80}{did_you_mean(name, types)}")
        return types[name]

    def group(self, name: str) -> ParameterGroup:
        """One group by name; raises ParameterError when there is none."""
        return self._groups.get(name) or self._type_of(name)()  # a stage registered since has its defaults

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self.group_types():
            raise AttributeError(name)
        return self.group(name)

    def with_groups(self: SetType, **groups: ParameterGroup) -> SetType:
        """A copy with whole groups exchanged."""
        return type(self)(**{**self._groups, **groups})

    def with_values(
        self: SetType, values: Mapping[str, Any], on_rename: Callable[[str], None] | None = None
    ) -> SetType:
        """A copy with {group: {field: value}} changed.

        Parameters
        ----------
        values : Mapping
            Values by group and field; fields under a former name are taken, too.
        on_rename : callable, optional
            Told of every former name in one sentence.

        Raises
        ------
        ParameterError
            For an unknown name, or a value that is not allowed.
        """
        changed = {}
        for name, fields in values.items():
            group = self.group(name)
            if not isinstance(fields, Mapping):
                raise ParameterError(
                    f"{name:.80} = {fields!r:.80} is not a table of fields: write {name}.field = value"
                )
            changed[name] = group.with_values(fields, on_rename)
        return self.with_groups(**changed)

    def with_assignments(
        self: SetType, assignments: Sequence[str], on_rename: Callable[[str], None] | None = None
    ) -> SetType:
        """A copy with `group.field=value` texts applied in order, as `--set` takes them; see `with_values`."""
        result = self
        for text in assignments:
            target, equals, value = text.partition("=")
            stage, dot, name = target.strip().partition(".")
            if not (equals and dot and stage and name):
                raise ParameterError(f"{text!r:.80} is not of the form stage.field=value, like logo.pad_px=3")
            result = result.with_values({stage: {name: value.strip()}}, on_rename)
        return result

    def value(self, name: str) -> Any:
        """Value of `group.field`."""
        group, _, field = name.partition(".")
        return getattr(self.group(group), field)

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """{group: {field: value}}."""
        return {name: self.group(name).as_dict() for name in self.group_types()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ParameterSet) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={self.group(name)!r}' for name in self.group_types())})"

    def _values(self) -> tuple[ParameterGroup, ...]:
        return tuple(self.group(name) for name in self.group_types())


SetType = TypeVar("SetType", bound=ParameterSet)


def _parsed(text: str) -> Any:
    lowered = text.lower()
    if lowered in ("true", "on", "yes"):
        return True
    if lowered in ("false", "off", "no"):
        return False
    if lowered in ("auto", "none"):
        return None
    if "," in text:
        return [_parsed(item.strip()) for item in text.strip("[]()").split(",")]
    try:
        return int(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return text
