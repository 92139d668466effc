"""Options and types of values that several commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.files import atomic_file
from spinscope.pipeline.recordings import TIME_UNITS, ReadingOptions
from spinscope.pipeline.registry import rival_methods
from spinscope.pipeline.session import Choices

RECORDING = click.Path(path_type=Path)


class SensorSize(click.ParamType[tuple[int, int]]):
    """WIDTHxHEIGHT in pixels."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Value of the option; fails with what is allowed."""
        width, _, height = str(value).lower().partition("x")
        if not (width.isdecimal() and height.isdecimal() and 1 <= int(width) <= 65536 and 1 <= int(height) <= 65536):
            self.fail(f"{value!r} is not a sensor size: write WIDTHxHEIGHT in pixels, like 1280x720", param, ctx)
        return int(width), int(height)


class FixedBall(click.ParamType[tuple[float, float, float] | str]):
    """`auto`, or three numbers (the command line's are joined by commas before click sees them)."""

    name = "X_PX Y_PX RADIUS_PX | auto"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float] | str:
        """Value of the option; fails with what is allowed."""
        if value == "auto":
            return "auto"
        try:
            x, y, radius = (float(number) for number in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is neither `auto` nor three numbers X_PX Y_PX RADIUS_PX", param, ctx)
        return x, y, radius


class RegisteredName(click.ParamType[str]):
    """Name of an entry of a registry, read when the command is called.

    Parameters
    ----------
    names : callable
        `names() -> sequence of str`: the names that are allowed.
    """

    name = "name"

    def __init__(self, names: Callable[[], Sequence[str]]) -> None:
        self._names = names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Value of the option; fails with what is allowed."""
        return click.Choice(self._names()).convert(value, param, ctx)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """Choices, for the help text."""
        return click.Choice(self._names()).get_metavar(param, ctx)


class CommandGroup(click.Group):
    """Group of commands whose help lists them in their order, each with its whole first sentence."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order in which they were added."""
        return list(self.commands)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list; click's own cuts the sentences off."""
        with formatter.section("Commands"):
            paragraphs = {name: (command.help or "").split("\n\n")[0] for name, command in self.commands.items()}
            formatter.write_dl([(name, " ".join(text.split())) for name, text in paragraphs.items()])


class ListingCommand(click.Command):
    """Command whose help ends with a list of entries, read when the help is shown.

    Parameters
    ----------
    title : str
        Heading of the list.
    entries : callable
        `entries() -> dict`: explanation of each entry by its name.
    """

    def __init__(self, *args: Any, title: str, entries: Callable[[], dict[str, str]], **rest: Any) -> None:
        super().__init__(*args, **rest)
        self._title, self._entries = title, entries

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the entries below the options."""
        with formatter.section(self._title):
            formatter.write_dl(list(self._entries().items()))


def _window(ctx: click.Context, param: click.Parameter, value: tuple[int, int] | None) -> tuple[int, int] | None:
    if value and value[0] >= value[1]:
        raise click.UsageError(f"--window {value[0]} {value[1]} is empty: START_US must be below END_US", ctx)
    return value


window_option = click.option(
    "--window",
    type=int,
    nargs=2,
    callback=_window,
    metavar="START_US END_US",
    help="Use only the events of [START, END), file time in us.",
)


rivals_given = click.option(
    "--rival",
    "rivals",
    type=RegisteredName(lambda: tuple(method.name for method in rival_methods())),
    multiple=True,
    help="Run a method of another publication besides, for comparison; repeatable.",
)


def reading_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the statements about a recording to a command, which gets them as one `reading`."""

    def with_reading(sensor: tuple[int, int] | None, dataset: str | None, time_unit: str | None, **rest: Any) -> None:
        command(reading=ReadingOptions(sensor=sensor, dataset=dataset, time_unit=time_unit), **rest)

    return _decorated(
        with_reading,
        command,
        click.option(
            "--sensor", type=SensorSize(), help="Size of the sensor in pixels, where the file does not say it."
        ),
        click.option("--dataset", metavar="PATH", help="Events to read where a file holds several streams."),
        click.option("--time-unit", type=click.Choice(TIME_UNITS), help="Unit of the times in a file of columns."),
    )


def _decorated(
    wrapper: Callable[..., None], command: Callable[..., None], *options: Callable[..., Any]
) -> Callable[..., None]:
    """The wrapper with the options, in this order, and with the command's name, help and options."""
    wrapper = functools.wraps(command)(wrapper)
    for option in reversed(options):
        wrapper = option(wrapper)
    return wrapper


def session_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a session to a command, which gets them as one `choices`."""
    options = (
        click.option(
            "--preset",
            metavar="NAME|FILE.toml",
            help="Settings to start from: default, paper, or a TOML file.",
        ),
        click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="STAGE.FIELD=VALUE",
            help="Change one setting; repeatable, like --set logo.pad_px=3.",
        ),
        window_option,
        click.option(
            "--fixed-ball",
            type=FixedBall(),
            help="The ball stays in place (ball spinner): its circle, or auto to find it.",
        ),
        click.option(
            "--flight-calibration",
            metavar="FILE.toml",
            help="Lift, drag and plumb line of the set-up, as `analyze --calibrate-flight` wrote them.",
        ),
    )

    def with_choices(
        preset: str | None,
        assignments: tuple[str, ...],
        window: tuple[int, int] | None,
        fixed_ball: tuple[float, float, float] | str | None,
        flight_calibration: str | None,
        reading: ReadingOptions,
        **rest: Any,
    ) -> None:
        command(choices=Choices(preset, assignments, window, fixed_ball, reading, flight_calibration), **rest)

    return reading_options(_decorated(with_choices, command, *options))


def rival_option(command: Callable[..., None]) -> Callable[..., None]:
    """Add the choice of other publications' methods to a command with the options of a session."""

    def with_rivals(rivals: tuple[str, ...], choices: Choices, **rest: Any) -> None:
        command(choices=replace(choices, rivals=rivals), **rest)

    return _decorated(with_rivals, command, rivals_given)


def page_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a served page to a command, which gets them as one `page`: arguments of `web.serve`."""

    def with_page(port: int | None, no_browser: bool, hosts: tuple[str, ...], **rest: Any) -> None:
        command(page={"port": port, "open_browser": not no_browser, "hosts": hosts}, **rest)

    return _decorated(
        with_page,
        command,
        click.option(
            "--port",
            type=click.IntRange(0, 65535),
            help="Port of the page; another free one is taken when it is busy.",
        ),
        click.option("--no-browser", is_flag=True, help="Only print the address."),
        click.option(
            "--allow-host",
            "hosts",
            multiple=True,
            metavar="NAME",
            help="Answer requests for this host, too, as behind a proxy; repeatable. An SSH tunnel needs none.",
        ),
    )


def write_text(output: str, text: str) -> None:
    """Write text to a file, which appears whole or not at all, or to standard output for "-"."""
    if output == "-":
        click.echo(text, nl=False)
    else:
        with atomic_file(output, "JSON") as part:
            part.write_text(text, encoding="utf-8")


def join_fixed_ball(arguments: list[str]) -> list[str]:
    """Join the values of `--fixed-ball X Y RADIUS` by commas: click wants a fixed number, and `auto` is one."""
    if "--fixed-ball" not in arguments:
        return arguments
    at = arguments.index("--fixed-ball") + 1
    if arguments[at : at + 1] == ["auto"] or "," in "".join(arguments[at : at + 1]):
        return arguments
    return [*arguments[:at], ",".join(arguments[at : at + 3]), *arguments[at + 3 :]]
