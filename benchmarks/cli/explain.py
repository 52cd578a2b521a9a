"""``topoloc explain``: why a run of the benchmark answered what it did at one frame."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.numbers import Whole
from topoloc.errors import UserError

if TYPE_CHECKING:
    from benchmarks.explanation import Explanation, Rerun


def explain(
    run: Annotated[Path, Parameter(help="Folder of a benchmark run.")],
    *,
    step: Annotated[Whole, Parameter(help="Frame, counted from 0, as the rows of steps.csv.", validator=Number(gte=0))],
    scenario: Annotated[str | None, Parameter(help="The run's first by default, as for the next three.")] = None,
    sensor: Annotated[str | None, Parameter(help="One of the run's sensors.")] = None,
    estimator: Annotated[str | None, Parameter(help="One of its estimators.")] = None,
    seed: Annotated[Whole | None, Parameter(help="One of its seeds.")] = None,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="Picture to make, a PNG; in the run's folder by default.")
    ] = None,
    as_json: Annotated[bool, Parameter(name="--json", help="Print JSON instead of tables.", negative="")] = False,
    overwrite: Annotated[bool, Parameter(help="Replace the picture named by -o if it exists.", negative="")] = False,
) -> None:
    """Tell why a benchmark run answered what it did at one frame.

    The drive is made again from its seed. Printed are the answer beside the truth, what the sensor saw, IMA's slots
    one by one, the thesis's Table 5.7 for its tracker, and the belief by node. A picture shows the frame, where it was
    found in the map, and the belief on the plan.

    Example: ``topoloc explain runs/mine --step 12 --sensor ima --estimator activity``
    """
    from benchmarks.choice import read_choice, suite_of
    from benchmarks.explanation import choose_key, difference, print_explanation, refuse_without_result, run_again
    from benchmarks.explanation import explain as explain_step

    picture = _refuse_place(output, overwrite)
    suite = suite_of(read_choice(run))
    key = choose_key(suite, scenario, sensor, estimator, seed)
    refuse_without_result(run, key)
    again = run_again(suite, key, step)
    told = explain_step(again)
    picture = picture or run / "explain-{}-{}-{}-{}-{}.png".format(*key, step)
    if differs := difference(run, again):
        print(f"warning: another version or machine? {run} differs: {differs}", file=sys.stderr)
    _draw(picture, again, told)
    if as_json:
        print(_json(told, picture))
        return
    print_explanation(told)
    _tell_unnamed(scenario=scenario, sensor=sensor, estimator=estimator, seed=seed)
    print(picture)


def _refuse_place(output: Path | None, overwrite: bool) -> Path | None:
    """The place for the picture, if one is named. Raises ``UserError`` for one that cannot be it."""
    from topoloc.files import refuse_to_overwrite

    if output is not None:
        if output.suffix.lower() != ".png":
            raise UserError(f"{output}: the picture is a PNG; end the name in .png")
        refuse_to_overwrite(output, overwrite)
    return output


def _draw(path: Path, again: Rerun, told: Explanation) -> None:
    from benchmarks.explanation import draw_explanation
    from topoloc.files import write_bytes
    from topoloc.plan import as_png

    write_bytes(path, as_png(draw_explanation(again, told)))


def _json(told: Explanation, picture: Path) -> str:
    from dataclasses import asdict

    return json.dumps({**asdict(told), "picture": str(picture)}, indent=2)


def _tell_unnamed(**parts: str | int | None) -> None:
    unnamed = [f"--{name}" for name, value in parts.items() if value is None]
    if unnamed:
        print(f"The first of the run was taken, since not named: {', '.join(unnamed)}.")
