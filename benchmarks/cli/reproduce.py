"""``topoloc reproduce``: the seeds' published experiments, published value beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.errors import InputError, UserError

if TYPE_CHECKING:
    from benchmarks.experiments.experiment import Experiment, Measured

ALL, SEED_FILES = "all", "seeds"
FIRST_SEED, SEEDS = 10, 10


def reproduce(
    names: Annotated[tuple[str, ...], Parameter(name="name", help="Experiments, or 'all'; none lists them.")] = (),
    *,
    seeds: Annotated[int, Parameter(help="How many seeds, counted from the first.", validator=Number(gte=1))] = SEEDS,
    first_seed: Annotated[int, Parameter(help="Nothing was fitted to 10 to 19.", validator=Number(gte=0))] = FIRST_SEED,
    jobs: Annotated[int, Parameter(help="Processes; -1: as many as there are cores.", validator=Number(gte=-1))] = -1,
    out: Annotated[Path | None, Parameter(help="Folder to make; runs/TIME-reproduce by default.")] = None,
    resume: Annotated[
        Path | None, Parameter(help="Folder of a run to go on with: its seeds are not done again.")
    ] = None,
) -> None:
    """Do published experiments again, in simulated worlds: a table and a picture each.

    Example: ``topoloc reproduce old-panoramas people``, ``topoloc reproduce zoom --seeds 3``
    """
    from topoloc import plugins

    if not names:
        _print_list()
        return
    if jobs == 0:
        raise UserError("--jobs is 0; give a number from 1 on, or -1 for as many as there are cores")
    chosen = plugins.names(plugins.EXPERIMENTS) if ALL in names else list(dict.fromkeys(names))
    experiments: list[Experiment] = [plugins.load(plugins.EXPERIMENTS, name) for name in chosen]
    folder = _folder(out, resume)
    chosen_seeds = range(first_seed, first_seed + seeds)
    for experiment in experiments:
        _print(experiment, chosen_seeds, _measured(experiment, chosen_seeds, folder, jobs), folder)


def _folder(out: Path | None, resume: Path | None) -> Path:
    if out is not None and resume is not None:
        raise UserError("--out makes a new folder and --resume goes on in an old one; give one of them")
    if resume is not None:
        if not resume.is_dir():
            raise InputError(resume, "no such folder", "name one that topoloc reproduce made")
        if any(resume.iterdir()) and not any(resume.glob(f"*/{SEED_FILES}")):
            raise InputError(resume, "holds no experiment", "name a folder that topoloc reproduce made")
        return resume
    folder = out or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-reproduce"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "exists already", f"name another folder, or go on with --resume {folder}")
    return folder


def _measured(experiment: Experiment, seeds: Sequence[int], folder: Path, jobs: int) -> list[Measured]:
    from benchmarks.experiments.experiment import measure_seeds
    from topoloc.cli.progress import bar

    made = measure_seeds(experiment, seeds, folder / experiment.name / SEED_FILES, jobs)
    with bar() as progress:
        return list(progress.track(made, total=len(seeds), description=experiment.name))


def _print(experiment: Experiment, seeds: Sequence[int], measured: Sequence[Measured], folder: Path) -> None:
    """The table on the screen, and table and picture in the folder."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from benchmarks.experiments.experiment import columns_of, lines_of

    console = Console(markup=False, emoji=False, highlight=False)
    told = f"{experiment.document} {experiment.source}; simulated, seeds: {len(measured)}"
    console.print(f"{experiment.title} ({told})", style="bold")
    columns = columns_of(measured)
    table = Table("", "published", "where", *columns, box=box.SIMPLE, padding=(0, 1, 0, 0))
    lines = lines_of(experiment, measured)
    for first in range(0, len(lines), len(columns)):
        row = lines[first : first + len(columns)]
        quantity = row[0].quantity
        table.add_row(quantity.what, quantity.published, quantity.where, *(line.text(with_range=False) for line in row))
    console.print(table)
    console.print("Over seeds: mean ± standard deviation; table.md has the range, too.")
    if experiment.tell is not None:
        console.print(experiment.tell(measured))
    for path in _written(experiment, seeds, measured, folder / experiment.name):
        console.print(str(path))


def _written(experiment: Experiment, seeds: Sequence[int], measured: Sequence[Measured], folder: Path) -> list[Path]:
    """Write ``table.md``, ``table.csv`` and ``figure.png``."""
    from benchmarks.experiments.experiment import lines_of, markdown
    from benchmarks.experiments.picture import write_figure
    from topoloc.files import write_csv, write_text

    table, numbers, figure = folder / "table.md", folder / "table.csv", folder / "figure.png"
    told = "" if experiment.tell is None else f"\n{experiment.tell(measured)}\n"
    write_text(table, f"# {experiment.title}\n\n{experiment.about}\n\n{markdown(experiment, measured)}{told}")
    rows = [
        (line.quantity.key, line.column, line.quantity.published, *line.values.tolist())
        for line in lines_of(experiment, measured)
    ]
    write_csv(numbers, ["key", "column", "published", *(f"seed {seed}" for seed in seeds)], rows)
    write_figure(figure, experiment, measured)
    return [table, numbers, figure]


def _print_list() -> None:
    from rich.console import Console
    from rich.table import Table

    from topoloc import plugins

    console = Console(markup=False, emoji=False, highlight=False)
    table = Table("name", "what it is", "published in")
    for name in plugins.names(plugins.EXPERIMENTS):
        experiment: Experiment = plugins.load(plugins.EXPERIMENTS, name)
        table.add_row(name, experiment.title, f"{experiment.document} {experiment.source}")
    console.print(table)
    console.print("topoloc reproduce NAME does one of them; topoloc reproduce all does all")
