"""`spinscope coach`: a session of shots for coaches."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.session import Choices

from ..terminal import note
from .live import run_camera, source_options
from .options import CommandGroup, page_options, session_options


class DefaultCommandGroup(CommandGroup):
    """Group that takes anything but the name of one of its commands as the arguments of `open`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put `open` before arguments that name no command."""
        is_help = args[:1] in (["-h"], ["--help"])
        known = args[:1] and args[0] in self.commands
        return super().parse_args(ctx, args if known or is_help else ["open", *args])


@click.group(cls=DefaultCommandGroup, context_settings={"help_option_names": ["-h", "--help"]})
def coach() -> None:
    """Show a session of shots to coach and players: kinds, numbers, comparison, tests, live.

    `spinscope coach` opens the sample session, `spinscope coach FILES FOLDERS` (short for `coach open ...`) recordings,
    folders of recordings, or sessions.
    """


@coach.command("open")
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path), metavar="[FILES | FOLDERS | SESSIONS]...")
@click.option(
    "--session",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the session that the recordings belong to; by default one of the user's own is made.",
)
@click.option("--jobs", type=click.IntRange(1), help="Processes that analyze; one a core by default.")
@page_options
@session_options
def open_page(
    paths: tuple[Path, ...],
    folder: Path | None,
    jobs: int | None,
    page: dict[str, Any],
    choices: Choices,
) -> None:
    """Open the page; recordings are analyzed in the background, folders are watched for new ones."""
    from ..coach.session import ShotSession
    from ..coach.session_analysis import SessionAnalysis
    from ..coach.session_folders import other_sessions, sample_session, session_for
    from ..web.coach_application import CoachState
    from ..web.server import serve_coach

    sessions = [ShotSession(path) for path in paths if ShotSession.is_session(path)]
    sources = [path for path in paths if not ShotSession.is_session(path)]
    for path in sources:
        if not path.exists():
            raise click.UsageError(f"there is no file or folder {path}")
    analyses: list[Any] = []
    if sources:
        session = session_for(sources) if folder is None else ShotSession(folder)
        sessions.insert(0, session)
        analyses.append(SessionAnalysis(session, sources, choices, jobs))
    elif folder is not None:
        sessions.insert(0, ShotSession(folder))
    if not sessions:
        sessions = [sample_session()]
    serve_coach(CoachState([*sessions, *other_sessions(sessions)], analyses), **page)


@coach.command("live")
@click.option(
    "--session",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the session that the shots belong to; by default one of the user's own, a day each.",
)
@page_options
@source_options
@session_options
def live_page(folder: Path | None, page: dict[str, Any], **options: Any) -> None:
    """Open the page on a running camera, or on a recording in its place: each shot appears as it ends."""
    from ..coach.session import ShotSession
    from ..coach.session_folders import live_session

    session = live_session() if folder is None else ShotSession(folder)
    run_camera(lines=None, coached={"session": session, **page}, **options)


def _words_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of language and units."""
    for option in (
        click.option("--language", type=click.Choice(["en", "de"]), default="en", show_default=True),
        click.option("--spin-unit", type=click.Choice(["rps", "rpm"]), default="rps", show_default=True),
        click.option("--speed-unit", type=click.Choice(["km_h", "m_s"]), default="km_h", show_default=True),
    ):
        command = option(command)
    return command


def _session(folder: Path | None) -> Any:
    """The session in a folder, the sample without one."""
    from ..coach.session import ShotSession
    from ..coach.session_folders import sample_session

    if folder is None:
        return sample_session()
    if not ShotSession.is_session(folder):
        raise click.UsageError(f"{folder} is no session: `spinscope coach open` makes one of recordings")
    return ShotSession(folder)


@coach.command()
@click.argument("session", required=False, type=click.Path(path_type=Path))
@click.option("--html", type=click.Path(path_type=Path), metavar="OUT.html", help="One file that needs nothing else.")
@click.option("--pdf", type=click.Path(path_type=Path), metavar="OUT.pdf", help="Needs `spinscope[report]`.")
@click.option("--table", type=click.Path(path_type=Path), metavar="OUT.csv|.parquet|.jsonl", help="A row a shot.")
@_words_options
def report(session: Path | None, html: Path | None, pdf: Path | None, table: Path | None, **units: Any) -> None:
    """Write a session's report or table; of the sample session without SESSION."""
    from ..coach.report import write_report
    from ..coach.session_table import write_session_table
    from ..coach.shot_words import ShotWords

    if not (html or pdf or table):
        raise click.UsageError("say what to write: --html, --pdf or --table")
    opened = _session(session)
    for path in filter(None, (html, pdf)):
        write_report(opened, path, ShotWords(**units))
        note(f"wrote {path}")
    if table:
        write_session_table(opened, table)
        note(f"wrote {table}")


@coach.command()
@click.argument("shot", type=int)
@click.option(
    "--session", "folder", type=click.Path(path_type=Path), help="Folder of the session; by default the sample."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="OUT.mp4")
@_words_options
def video(shot: int, folder: Path | None, out: Path, **units: Any) -> None:
    """Write the video of a shot, told by its `id` in the session's table; needs `spinscope[video]`."""
    from ..coach.shot_words import ShotWords
    from ..coach.video import write_video

    row = _session(folder).shot(shot)
    write_video(row, row["detail"], out, ShotWords(**units))
    note(f"wrote {out}")
