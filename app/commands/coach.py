"""`spinscope coach`: a session of shots for coaches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.session import Choices

from .options import session_options


class DefaultCommandGroup(click.Group):
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
@click.option(
    "--port", type=click.IntRange(0, 65535), help="Port of the page; another free one is taken when it is busy."
)
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@session_options
def open_page(
    paths: tuple[Path, ...],
    folder: Path | None,
    jobs: int | None,
    port: int | None,
    no_browser: bool,
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
    serve_coach(CoachState([*sessions, *other_sessions(sessions)], analyses), port, open_browser=not no_browser)
