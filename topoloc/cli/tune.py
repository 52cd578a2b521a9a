"""``topoloc tune``: settings chosen on recorded drives, and what each costs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from topoloc.geometry import Floats
    from topoloc.metrics import Metric
    from topoloc.tuning import Plan, Tuned
    from topoloc.tuning.choice import Choice

OUTPUTS = ("tune.csv", "settings.toml", "tune.png")


def tune(
    topo_map: Annotated[Path, Parameter(name="map", help="Map folder, or a text map.")],
    recordings: Annotated[
        tuple[Path, ...],
        Parameter(name="recording", help="Recording folders with ground truth; one or more.", negative=""),
    ],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Folder to make.")],
    sensor: Annotated[str, Parameter(help="See 'topoloc list sensors'; several as one: a+b, 'mix(a,b)'.")] = "ima",
    estimator: Annotated[str, Parameter(help="See 'topoloc list estimators'.")] = "activity",
    tries: Annotated[
        tuple[str, ...],
        Parameter(name="--try", help="sensor.KEY=1,2,3 or estimator.KEY=...: try these, not ours.", negative=""),
    ] = (),
    score: Annotated[str, Parameter(help="A metric, higher or lower of which is better.")] = "node_accuracy",
    folds: Annotated[
        int | None,
        Parameter(help="Cut each recording into so many stretches, not into laps.", validator=Number(gte=1)),
    ] = None,
    seed: Annotated[int, Parameter(help="Of the estimator's random numbers.", validator=Number(gte=0))] = 0,
    jobs: Annotated[int | None, Parameter(help="Processes; the cores by default.", validator=Number(gte=1))] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the files of an earlier run.", negative="")] = False,
) -> None:
    """Choose settings of a sensor, an estimator and the odometer's noise on recorded laps, by cross-validation.

    The recordings are cut into laps. Settings are chosen on all laps but one, one setting at a time, and measured on
    the lap left out, beside the defaults; so for each lap. The proposal is what is best on all of them. Writes
    ``tune.csv`` (all that was tried), ``settings.toml`` (the proposal) and ``tune.png``.

    Example: ``topoloc tune lab/map lab/recording -o tuned``,
    ``topoloc tune map drive1 drive2 -o tuned --estimator particle --try sensor.slots=6,10 --try sensor.zoom=1,1.2``
    """
    from joblib import cpu_count

    from topoloc.cli.progress import bar
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.recording import Recording
    from topoloc.topo_map import TopoMap
    from topoloc.tuning import plan_of

    refuse_to_overwrite(output, overwrite)
    plan = plan_of(
        TopoMap.load(topo_map),
        [Recording.load(recording) for recording in recordings],
        _metric(score),
        sensor=sensor,
        estimator=estimator,
        tries=tries,
        folds=folds,
        seed=seed,
    )
    _tell_plan(plan)
    with new_folder(output, overwrite, owned=OUTPUTS) as folder:
        with bar() as progress:
            task = progress.add_task("tuning", total=plan.trials)
            tuned = plan.carry_out(jobs or cpu_count(), lambda: progress.advance(task))
        _write(folder, tuned)
    _report(tuned)
    print(f"{output}: {', '.join(OUTPUTS)}")
    _tell_next(tuned, f"topoloc localize {topo_map} RECORDING -o RUN --sensor '{sensor}' --estimator {estimator}")


def _metric(name: str) -> Metric:
    """The metric of that name. Raises ``UnknownName`` where no more or less of it is better."""
    from topoloc.errors import UnknownName
    from topoloc.tuning.trial import TELLING

    known = {metric.name: metric for metric in TELLING if metric.better in ("higher", "lower")}
    if name not in known:
        raise UnknownName("score", name, list(known))
    return known[name]


def _tell_plan(plan: Plan) -> None:
    looks, first, last = [len(fold.pictures) for fold in plan.folds], plan.folds[0].name, plan.folds[-1].name
    length = sum(fold.metres for fold in plan.folds)
    print(f"{len(looks)} folds, {first} to {last}: {min(looks)} to {max(looks)} looks each, {length:.0f} m together")


def _write(folder: Path, tuned: Tuned) -> None:
    from topoloc.files import write_bytes, write_csv, write_text
    from topoloc.plan import as_png
    from topoloc.tuning.picture import draw_tuning
    from topoloc.tuning.written import TUNE_COLUMNS, settings_toml, tune_rows

    write_csv(folder / "tune.csv", TUNE_COLUMNS, tune_rows(tuned))
    write_text(folder / "settings.toml", settings_toml(tuned))
    write_bytes(folder / "tune.png", as_png(draw_tuning(tuned)))


def _report(tuned: Tuned) -> None:
    """Print what each value does alone, the odometer's noise, and what the choice is worth where it was not made."""
    from rich.console import Console

    from topoloc.tuning.choice import Choice

    console = Console(markup=False, emoji=False, highlight=False)
    _print_settings(console, tuned)
    if tuned.noise.told:
        _print_noise(console, tuned)
    print(f"defaults on the same folds: {_mean(tuned.scores(Choice()))} {tuned.score.name}")
    print(f"chosen without the fold:    {_mean(tuned.held_out_scores)}, {_gain(tuned)}")
    print(f"proposal on its own folds:  {_mean(tuned.scores(tuned.proposal))} (too good: it was chosen there)")
    print(tuned.verdict.words)


def _print_settings(console: Console, tuned: Tuned) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for title in ("setting", "score", "gain", "ms look", "ms update", ""):
        table.add_column(title, no_wrap=True)
    for one in tuned.tunables:
        table.add_row(one.key)
        for word in (one.default, *one.others):
            mark = "default" if word == one.default else "proposal" if word == tuned.proposal.word(one) else ""
            table.add_row(f"  {word}", *_cells(tuned, tuned.alone[one.key, word]), mark)
    unit = f" [{tuned.score.unit}]" if tuned.score.unit else ""
    told = f"{tuned.score.label}{unit}, mean and deviation over {len(tuned.folds)} folds"
    print(f"each setting alone, all others at their defaults; {told}:")
    console.print(table)


def _cells(tuned: Tuned, choice: Choice) -> tuple[str, ...]:
    """Of a choice: score, by how much it is better than the defaults, milliseconds."""
    from topoloc.tuning.choice import Choice

    outcome, scores = tuned.outcomes[choice], tuned.scores(choice)
    if outcome.refused:
        return "refused", "", "", ""
    gain = (scores - tuned.scores(Choice())).mean() * (1.0 if tuned.score.better == "higher" else -1.0) + 0.0  # no -0
    return _mean(scores), f"{gain:+.3f}", f"{outcome.look_ms:.2f}", f"{outcome.update_ms:.2f}"


def _print_noise(console: Console, tuned: Tuned) -> None:
    from dataclasses import asdict

    from rich.table import Table

    from topoloc.odometry import OdometryNoise

    default, fitted = asdict(OdometryNoise()), asdict(tuned.noise.noise)
    table = Table("noise of the odometer", "default", "estimated")
    for name in default:
        if not name.startswith("unknown"):
            table.add_row(name, f"{default[name]:g}", f"{fitted[name]:g}")
    console.print(table)
    kept = f"{tuned.noise.motions} motions of one look and more"
    if tuned.noise.left_out:
        kept += f", {tuned.noise.left_out} left out: the odometer missed them altogether"
    print(f"from {kept}; errors are {tuned.noise.beside_default:.2g} times what the defaults expect")
    print(f"a motion of a fold left out is {tuned.noise_gains.mean():+.2f} nats likelier than under the defaults")


def _mean(scores: Floats) -> str:
    return f"{scores.mean():.3f} ± {scores.std(ddof=1):.3f}"


def _gain(tuned: Tuned) -> str:
    verdict = tuned.verdict
    return f"better by {verdict.gain:+.3f} ± {verdict.spread:.3f} a fold"


def _tell_next(tuned: Tuned, command: str) -> None:
    """The command that takes the proposal, on a recording that it was not chosen on."""
    from topoloc.tuning.written import noise_words, set_words

    words = set_words(tuned.proposal)
    kind = "proposal" if tuned.verdict.better or not words else "proposal, not told from chance"
    print(f"{kind}: {_as_options(words) or 'the defaults'}")
    if tuned.noise.worse and not any(word.startswith("odometry.") for word in words):
        print(f"the odometer is worse than the defaults take it to be: {_as_options(noise_words(tuned.noise.noise))}")
    print(f"next: {command} {_as_options(words) if tuned.verdict.better else ''}".rstrip())


def _as_options(words: Sequence[str]) -> str:
    return " ".join(f"--set {word}" for word in words)
