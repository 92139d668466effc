"""`spinscope evaluate`: the paper's experiments on simulated recordings."""

from __future__ import annotations

from pathlib import Path

import click

from ..terminal import ProgressBar, note


def _list_suites(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from ..evaluate import suite_list

        click.echo(suite_list())
        context.exit()


@click.command()
@click.argument("suites", nargs=-1, required=True, metavar="SUITE...")
@click.option(
    "--list", is_flag=True, is_eager=True, expose_value=False, callback=_list_suites, help="List the suites and exit."
)
@click.option("--quick", is_flag=True, help="A thinned suite, about ten seconds.")
@click.option("--json", "output", type=click.Path(path_type=Path), metavar="OUT", help="Write JSON, one suite a line.")
@click.option("--figures", type=click.Path(path_type=Path), metavar="DIR", help="Write figures (PNG) and rows (CSV).")
@click.option("--page", type=click.Path(path_type=Path), metavar="FILE.md", help="Write tables and figures as a page.")
@click.option("--cluster", metavar="ADDRESS", help="Scheduler of a running Dask cluster that does the work.")
@click.option("--workers", type=click.IntRange(0), help="Processes on this machine; one a core by default.")
def evaluate(
    suites: tuple[str, ...],
    quick: bool,
    output: Path | None,
    figures: Path | None,
    page: Path | None,
    cluster: str | None,
    workers: int | None,
) -> None:
    """Run the paper's experiments on simulated recordings, next to the paper's own numbers.

    `spinscope evaluate --list` lists the suites. Recordings and results are kept, so that an interrupted run resumes
    where it stopped.
    """
    from .. import evaluate as running

    done, pictures = [], []
    for suite in suites:
        with ProgressBar() as bar:
            done.append(running.evaluate_suite(suite, quick=quick, workers=workers, cluster=cluster, on_progress=bar))
        running.print_evaluation(done[-1])
        if figures:
            for path in running.write_figures(done[-1], figures):
                note(f"wrote {path}")
                pictures.append(path)
    if output:
        running.write_json(done, output)
    if page:
        running.write_page(done, page, pictures)
