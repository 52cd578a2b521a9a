"""What a published experiment is: something measured on a seed, held beside what was printed, with a picture."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from topoloc.errors import InputError
from topoloc.files import read_text, write_text
from topoloc.geometry import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEDS = tuple(range(10, 20))
"""Nothing was fitted to them: worlds, sensors and rules were, on seeds from 1000 on."""
THESIS, SECOND_SEED, THIRD_SEED = "thesis", "Porta & Kröse", "Payá et al."
"""What the experiments were published in."""
NOT_IN_THE_SEED = "not in the seed"
"""What stands for a published value that did not survive: curves of a figure that is lost."""
AS_PUBLISHED, IMPROVED = "as published", "improved"
"""The thesis's method with the thesis's settings (5.2), and ours, in one setting everywhere."""
Measured = Mapping[str, Mapping[str, Any]]
"""Of one seed, by column of the table (such as ``AS_PUBLISHED``) and key: numbers, or lists of them for pictures."""


@dataclass(frozen=True)
class Quantity:
    """A row of the table.

    Attributes:
        key: of the measurement.
        what: it is, with its unit unless it is a share.
        published: as printed in the seed; "-" where it is not.
        where: in the seed.
        digits: places behind the point.
        percent: the value is a share, and shown in per cent.
        detail: the command's table has it, and the page does not.
    """

    key: str
    what: str
    published: str
    where: str
    digits: int = 2
    percent: bool = False
    detail: bool = False

    def shown(self, value: float) -> str:
        """A value as the table has it."""
        return f"{100.0 * value:.{max(self.digits - 2, 0)}f} %" if self.percent else f"{value:.{self.digits}f}"


@dataclass(frozen=True)
class Experiment:
    """A published experiment, done again in a simulated world.

    Attributes:
        name: as the command line has it.
        title: one line.
        source: section, tables and figures of the seed.
        about: what is done, how it departs from the published one, and what the rows mean; some sentences.
        measure: a seed -> what was measured; a function of a module, so that processes can share the seeds.
        quantities: rows of the table.
        draw: the published figure drawn anew into an empty one, from all seeds.
        tell: further lines for the screen, such as a published table of single steps; None: nothing more.
        document: that it was published in.
    """

    name: str
    title: str
    source: str
    about: str
    measure: Callable[[int], Measured]
    quantities: tuple[Quantity, ...]
    draw: Callable[[Sequence[Measured], Figure], None]
    tell: Callable[[Sequence[Measured]], str] | None = None
    document: str = THESIS


@dataclass(frozen=True)
class Line:
    """A row of a finished table.

    Attributes:
        quantity: what it tells.
        column: which of the methods.
        values: (S,) of the seeds; NaN where one has none.
    """

    quantity: Quantity
    column: str
    values: Floats

    def text(self, with_range: bool = True) -> str:
        """Mean, sample standard deviation and, in brackets, range over the seeds."""
        known = self.values[np.isfinite(self.values)]
        if not len(known):
            return "-"
        low, mean, high = (self.quantity.shown(float(value)) for value in (known.min(), known.mean(), known.max()))
        spread = f" ± {self.quantity.shown(float(known.std(ddof=1)))}" if len(known) > 1 else ""
        return f"{mean}{spread}" + (f" ({low} to {high})" if with_range else "")


def columns_of(measured: Sequence[Measured]) -> list[str]:
    """The columns that any seed has, in their order."""
    return list(dict.fromkeys(column for one in measured for column in one))


def lines_of(experiment: Experiment, measured: Sequence[Measured]) -> list[Line]:
    """The table: a line for each quantity and column."""
    return [
        Line(
            quantity, column, np.array([one.get(column, {}).get(quantity.key, np.nan) for one in measured], dtype=float)
        )
        for quantity in experiment.quantities
        for column in columns_of(measured)
    ]


def markdown(experiment: Experiment, measured: Sequence[Measured], details: bool = True) -> str:
    """The table in Markdown: published beside ours, mean ± standard deviation (least to most) over seeds."""
    columns = columns_of(measured)
    text = {(line.quantity.key, line.column): line.text() for line in lines_of(experiment, measured)}
    lines = [f"| | published | where | {' | '.join(columns)} |", "|---" * (3 + len(columns)) + "|"]
    for quantity in experiment.quantities:
        if quantity.detail and not details:
            continue
        cells = [text[quantity.key, column] for column in columns]
        lines.append(f"| {' | '.join([quantity.what, quantity.published, quantity.where, *cells])} |")
    return "\n".join(lines) + "\n"


def measure_seeds(experiment: Experiment, seeds: Sequence[int], folder: Path, jobs: int) -> Iterator[Measured]:
    """Measure each seed, in their order; what is in the folder already is read, and the rest written there.

    Args:
        experiment: whose.
        seeds: which.
        folder: a file ``<seed>.json`` each, written whole as soon as the seed is done.
        jobs: processes, as joblib counts them.

    Raises:
        InputError: a file there is of another experiment, seed or code, or no measurement at all.
    """
    files = {seed: folder / f"{seed}.json" for seed in seeds}
    kept = {seed: _read(path, experiment.name, seed) for seed, path in files.items() if path.exists()}
    missing = [seed for seed in seeds if seed not in kept]
    made = Parallel(n_jobs=jobs, return_as="generator")(delayed(_measure)(experiment, seed, folder) for seed in missing)
    yield from (kept[seed] if seed in kept else next(made) for seed in seeds)


def _measure(experiment: Experiment, seed: int, folder: Path) -> Measured:
    with threadpool_limits(1):
        measured = experiment.measure(seed)
    text = json.dumps({**_origin(experiment.name, seed), "measured": measured})
    write_text(folder / f"{seed}.json", text)
    read: Measured = json.loads(text)["measured"]  # as it will be read again: no tuples, no numpy
    return read


def _origin(name: str, seed: int) -> dict[str, str | int]:
    """What a measurement is known by: numbers of other code in one table could not be told apart."""
    return {"experiment": name, "seed": seed, "topoloc": version("topoloc"), "code": _code()}


@cache
def _code() -> str:
    """A digest of all Python files of the four rooms."""
    root, digest = Path(__file__).parents[2], hashlib.sha256()
    for room in ("topoloc", "sensors", "estimators", "benchmarks"):
        for file in sorted((root / room).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _read(path: Path, name: str, seed: int) -> Measured:
    remedy = "delete it, or start anew with --out in another folder"
    try:
        held = json.loads(read_text(path, remedy))
        found, measured = {key: held[key] for key in _origin(name, seed)}, held["measured"]
    except (json.JSONDecodeError, KeyError, TypeError):
        raise InputError(path, "holds no measurement", remedy) from None
    for key, value in _origin(name, seed).items():
        if found[key] != value:
            raise InputError(path, f"was measured with another {key} ({found[key]}, not {value})", remedy)
    read: Measured = measured
    return read
