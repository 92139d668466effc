"""`spinscope evaluate`: the paper's experiments on simulated and on real recordings."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ..terminal import ProgressBar, note
from .options import rivals_given


def _list_suites(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from ..evaluate import suite_list

        click.echo(suite_list())
        context.exit()


DATASET = "dataset"  # in place of a suite: a training set


@click.command()
@click.argument("suites", nargs=-1, metavar="SUITE...")
@click.option(
    "--list", is_flag=True, is_eager=True, expose_value=False, callback=_list_suites, help="List the suites and exit."
)
@click.option(
    "--real",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Run on the real recordings of a folder, with truth from their sidecars.",
)
@click.option(
    "--check",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Check a folder of real recordings against the recording protocol, and run no suite.",
)
@click.option("--preset", metavar="NAME|FILE.toml", help="Settings to start from: default, paper, or a TOML file.")
@click.option(
    "--set", "assignments", multiple=True, metavar="STAGE.FIELD=VALUE", help="Change one setting; repeatable."
)
@click.option("--ball", type=click.IntRange(1, 7), help="Only this ball of the paper's, 1 to 7.")
@click.option("--lens-mm", type=click.FloatRange(1.0, 200.0), help="Focal length of the lens, in mm.")
@rivals_given
@click.option("--quick", is_flag=True, help="A thinned suite, about ten seconds.")
@click.option("--json", "output", type=click.Path(path_type=Path), metavar="OUT", help="Write JSON, one suite a line.")
@click.option("--figures", type=click.Path(path_type=Path), metavar="DIR", help="Write figures (PNG) and rows (CSV).")
@click.option(
    "--page",
    type=click.Path(path_type=Path),
    metavar="FILE.md",
    help="Write tables and figures as a page, and the tables as JSON beside it.",
)
@click.option("--out", type=click.Path(path_type=Path), metavar="FOLDER", help="With dataset: folder to write it to.")
@click.option("--shards", type=click.IntRange(1), default=16, show_default=True, help="With dataset: number of files.")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="With dataset: another set for each."
)
@click.option("--cluster", metavar="ADDRESS", help="Scheduler of a running Dask cluster that does the work.")
@click.option("--workers", type=click.IntRange(0), help="Processes on this machine; one a core by default.")
def evaluate(
    suites: tuple[str, ...],
    real: Path | None,
    check: Path | None,
    preset: str | None,
    assignments: tuple[str, ...],
    ball: int | None,
    lens_mm: float | None,
    rivals: tuple[str, ...],
    quick: bool,
    output: Path | None,
    figures: Path | None,
    page: Path | None,
    out: Path | None,
    shards: int,
    seed: int,
    cluster: str | None,
    workers: int | None,
) -> None:
    """Run the paper's experiments on simulated or real recordings, next to the paper's own numbers.

    `spinscope evaluate --list` lists the suites. Recordings and results are kept, so that an interrupted run resumes
    where it stopped.

    `spinscope evaluate dataset --out FOLDER` writes a training set for learned estimators instead: windows of logo
    events on simulated balls with their true spin.
    """
    from spinscope.pipeline.evaluation import SceneChoices
    from spinscope.pipeline.evaluation.suite import check_choices
    from spinscope.pipeline.session import Choices

    from .. import evaluate as running

    choices, scene = Choices(preset, assignments, rivals=rivals), SceneChoices(ball, lens_mm)
    if check is not None:
        sys.exit(running.check_folder(check, choices))
    if (suites == (DATASET,)) != (out is not None):
        raise click.UsageError(
            f"`spinscope evaluate {DATASET} --out FOLDER` writes a training set: give both, or neither"
        )
    if out is not None:
        with ProgressBar() as bar:
            said = running.make_training_set(
                out, shards=shards, seed=seed, workers=workers, cluster=cluster, choices=choices, on_progress=bar
            )
        note(said)
        return
    if not suites:
        raise click.UsageError("name a suite: `spinscope evaluate --list` lists them")
    if real is not None and quick:
        raise click.UsageError("--quick thins simulated suites: leave it out with --real")
    for suite in suites:
        check_choices(suite, choices, scene, is_real=real is not None)
    done, pictures = [], []
    for suite in suites:
        with ProgressBar() as bar:
            evaluation = running.evaluate_suite(
                suite,
                quick=quick,
                workers=workers,
                cluster=cluster,
                choices=choices,
                scene=scene,
                real=real,
                on_progress=bar,
            )
        done.append(evaluation)
        running.print_evaluation(done[-1])
        if figures:
            for path in running.write_figures(done[-1], figures):
                note(f"wrote {path}")
                pictures.append(path)
    if output:
        running.write_json(done, output)
    if page:
        running.write_page(done, page, pictures)
