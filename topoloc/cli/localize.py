"""``topoloc localize``: run one sensor and one estimator over a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from topoloc.interfaces import Sensor, Upkeep
    from topoloc.localizer import Localizer, Step
    from topoloc.metrics import Run
    from topoloc.recording import Recording
    from topoloc.topo_map import TopoMap

OUTPUTS = ("trajectory.txt", "steps.csv", "plan.png", "metrics.json")
BEFORE = "before"
"""Folder of a refreshed map that holds the panoramas as they were."""
SETTINGS_HELP = (
    "sensor.KEY=VALUE or estimator.KEY=VALUE, as 'topoloc list' names them; sensor.NAME.KEY=VALUE for one of several; "
    "odometry.KEY=VALUE for the odometer's noise, as 'topoloc tune' proposes it."
)


def localize(
    topo_map: Annotated[Path, Parameter(name="map", help="Map folder, or a text map.")],
    recording: Annotated[Path, Parameter(help="Recording folder, TUM RGB-D layout.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Folder to make.")],
    sensor: Annotated[str, Parameter(help="See 'topoloc list sensors'; several as one: a+b, 'mix(a,b)'.")] = "ima",
    estimator: Annotated[str, Parameter(help="See 'topoloc list estimators'.")] = "activity",
    seed: Annotated[int, Parameter(help="Of the estimator's random numbers.", validator=Number(gte=0))] = 0,
    settings: Annotated[
        tuple[str, ...],
        Parameter(name="--set", help=SETTINGS_HELP),
    ] = (),
    upkeep: Annotated[
        Path | None,
        Parameter(help="Refresh panoramas on the way; map folder to make. Its settings: --set upkeep.KEY=VALUE."),
    ] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the files of an earlier run.", negative="")] = False,
) -> None:
    """Localize a recorded drive on a map.

    Writes ``trajectory.txt`` (TUM), ``steps.csv`` (a row per frame), ``plan.png`` and, where the recording has ground
    truth, ``metrics.json``. With ``--upkeep`` the panoramas are refreshed from frames taken where the localizer is
    sure; the map so refreshed is written, too, with the panoramas as they were in its folder ``before``.

    Example: ``topoloc localize lab/map lab/recording -o run --estimator particle --set estimator.particles=5000``
    """
    from contextlib import nullcontext

    from topoloc import plugins
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.localizer import Localizer
    from topoloc.odometry import OdometryNoise
    from topoloc.recording import Recording
    from topoloc.settings import build, parse_words, refuse_unknown
    from topoloc.topo_map import TopoMap

    refuse_to_overwrite(output, overwrite)
    the_map = TopoMap.load(topo_map)
    drive = Recording.load(recording).on(the_map.camera)
    tables = parse_words(settings)
    refuse_unknown(tables, {"sensor", "estimator", "odometry"} | ({"upkeep"} if upkeep else set()), "--set")
    eye = plugins.make_sensor(sensor, tables.get("sensor"))
    mind = plugins.make_estimator(estimator, tables.get("estimator"))
    noise = build(OdometryNoise, tables.get("odometry", {}), "settings of odometry")
    _refuse_blindness(drive, sensor, eye)
    keeper = None if upkeep is None else _keeper(the_map, eye, tables.get("upkeep"), (upkeep, output))
    # The folder comes before the work: a place that cannot be written shows at once.
    with (
        new_folder(output, overwrite, owned=OUTPUTS) as folder,
        nullcontext() if upkeep is None else new_folder(upkeep) as map_folder,
    ):
        steps = _localized(drive, Localizer(the_map, eye, mind, rng=seed, noise=noise, upkeep=keeper))
        run = _write(folder, the_map, drive, steps, f"{sensor} with {estimator}")
        if keeper is not None and map_folder is not None:
            _write_map(map_folder, keeper)
    _report(output, steps, run)
    if keeper is not None:
        print(f"{upkeep}: the map; panoramas refreshed: {_refreshed(keeper)}")


def _localized(drive: Recording, localizer: Localizer) -> list[Step]:
    """A step for each frame of a recording."""
    from topoloc.cli.progress import track

    steps = []
    for picture in track(drive.pictures[drive.kind], "localizing"):
        localizer.step(drive.frame(picture))
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
    _refuse_darkness(drive, steps)
    return steps


def _keeper(the_map: TopoMap, eye: Sensor, settings: Mapping[str, Any] | None, folders: tuple[Path, Path]) -> Upkeep:
    """What refreshes the panoramas that the sensor has; the folders are the new map's and the run's."""
    from topoloc import plugins
    from topoloc.errors import InputError, UserError
    from topoloc.settings import build

    if folders[0].exists() and (not folders[0].is_dir() or any(folders[0].iterdir())):
        raise InputError(folders[0], "exists already", "name another folder: --upkeep replaces no map")
    if folders[0].resolve() == folders[1].resolve():
        raise UserError(f"{folders[0]}: is named by both --upkeep and --output; name two folders")
    kind = plugins.load(plugins.UPKEEPS, "panoramas")
    keeper: Upkeep = kind(the_map, eye, build(kind.Config, settings or {}, "settings of upkeep"))
    return keeper


def _write_map(folder: Path, keeper: Upkeep) -> None:
    """The refreshed map, and beside it the panoramas before, under their names in ``nodes.csv``."""
    from topoloc.files import write_image
    from topoloc.map_folder import NODE_COLUMNS, NODES_FILE, rows_of

    keeper.topo_map.save(folder)
    written = rows_of(folder / NODES_FILE, NODE_COLUMNS, "it was just written")
    names = [Path(row["panorama"]).name for _, row in written]
    for node, panorama in keeper.before.items():
        write_image(folder / BEFORE / names[node], panorama)


def _refreshed(keeper: Upkeep) -> str:
    """Ids of the nodes whose panorama is another now."""
    return ", ".join(keeper.topo_map.nodes[node].id for node in sorted(keeper.before)) or "none"


def _refuse_blindness(drive: Recording, name: str, eye: Sensor) -> None:
    """A sensor whose kind of image was never recorded would be blind at every frame."""
    from topoloc.errors import InputError

    missing = eye.needs - frozenset(drive.pictures)
    if missing:
        lists = ", ".join(f"{kind}.txt" for kind in sorted(missing))
        raise InputError(drive.folder, f"{name} needs {lists}", "record it, or choose another --sensor")


def _refuse_darkness(drive: Recording, steps: Sequence[Step]) -> None:
    """A recording of which not one picture can be read is a mistake, not a blind robot."""
    from topoloc.errors import InputError

    looks = [step for step in steps if step.kind != "gated"]
    if all(step.kind == "unreadable" for step in looks):
        listed = drive.folder / f"{drive.kind}.txt"
        raise InputError(listed, f"none of its pictures can be used: {looks[0].problem}", "correct the paths")


def _write(folder: Path, the_map: TopoMap, drive: Recording, steps: Sequence[Step], title: str) -> Run | None:
    """Write the results; returns what the metrics are computed from, where there is ground truth."""
    import json

    import numpy as np

    from topoloc.files import write_bytes, write_text
    from topoloc.metrics import Run, evaluate
    from topoloc.plan import as_png, dead_reckoning, draw_plan
    from topoloc.recording import write_track
    from topoloc.steps import write_steps

    poses = np.array([step.estimate.pose for step in steps])
    times = [step.timestamp for step in steps]
    run: Run | None = None
    truth = odometry = None
    if drive.truth is not None:
        truth = np.array([drive.truth.at(time) for time in times])
        run = Run.of(the_map, steps, truth)
        write_text(folder / "metrics.json", json.dumps(evaluate(run), indent=2) + "\n")
    if drive.odometry is not None:
        raw = np.array([drive.odometry.at(time) for time in times])
        odometry = dead_reckoning(raw, poses[0] if truth is None else truth[0])
    wrong = [] if run is None else [int(i) for i in run.updates[~run.right]]
    write_track(folder / "trajectory.txt", times, poses)
    write_steps(folder / "steps.csv", the_map, steps)
    write_bytes(folder / "plan.png", as_png(draw_plan(the_map, poses, truth, odometry, wrong, title)))
    return run


def _report(output: Path, steps: Sequence[Step], run: Run | None) -> None:
    """Print what came of it: how many frames of each kind, how good, what could not be read."""
    import sys
    from collections import Counter

    from rich.console import Console
    from rich.table import Table

    from topoloc.metrics import METRICS

    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(Counter(step.kind for step in steps).items()))
    print(f"{len(steps)} frames: {kinds}")
    if run is not None:
        table = Table("metric", "value", "unit")
        for metric in METRICS:
            value = metric.value(run)
            table.add_row(metric.name, "" if value is None else f"{value:.3f}", metric.unit)
        Console().print(table)
    unreadable = [step.problem for step in steps if step.kind == "unreadable"]
    if unreadable:
        print(f"warning: frames counted as blind: {len(unreadable)}; first: {unreadable[0]}", file=sys.stderr)
    print(f"{output}: trajectory.txt, steps.csv, plan.png" + (", metrics.json" if run is not None else ""))
