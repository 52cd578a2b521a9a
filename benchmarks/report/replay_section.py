"""The replay: for each scenario a player, with a plan, pictures and tables that the page's script moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from string import Template
from typing import Any

from benchmarks.report import replay_data
from benchmarks.report.commands import explain_command
from benchmarks.report.compact import ACCOUNTS, KINDS, STATES
from benchmarks.report.markup import asset, json_script, options, select
from benchmarks.report.plan import plan_svg
from benchmarks.report.replay_data import (
    Looks,
    Pictures,
    Replays,
    panoramas_of,
    read_looks,
    read_replays,
    size_of,
    stride_of,
)
from benchmarks.report.replay_files import DriveRead
from benchmarks.report.run_read import RunRead
from benchmarks.spread import Pair

SPEEDS, SPEED = (1, 2, 4, 8), 2
"""That can be chosen, and the first one [frames/s]."""


def replay_section(run: RunRead, drives: Mapping[str, DriveRead | str], ranked: Sequence[Pair]) -> str:
    """A player for each scenario.

    Args:
        run: the run.
        drives: by scenario, or why there is none.
        ranked: pairs, those first that are kept first.
    """
    kept = {name: drive for name, drive in drives.items() if isinstance(drive, DriveRead)}
    looks = read_looks(run, list(kept))
    replays = read_replays(run, list(kept), ranked, replay_data.ANSWERS_BYTES - size_of(list(looks.values())))
    pictures = Pictures([], {})
    share = replay_data.PICTURES_BYTES // max(len(kept), 1)
    players = []
    for scenario in run.scenarios:
        drive = drives[scenario]
        if not isinstance(drive, DriveRead):
            players.append(_none(scenario, f"No replay: {drive}."))
        elif not any(group[0] == scenario for group in replays):
            players.append(_none(scenario, "No run on the drive that is shown has ended."))
        else:
            data = _data(run, scenario, drive, looks, replays, pictures, share)
            players.append(_player(scenario, drive, data, share))
    return "".join(players) + json_script("pictures", pictures.urls)


def _none(scenario: str, why: str) -> str:
    return f"<section><h3>{escape(scenario)}</h3><p>{escape(why)}</p></section>"


def _data(
    run: RunRead, scenario: str, drive: DriveRead, looks: Looks, replays: Replays, pictures: Pictures, share: int
) -> dict[str, Any]:
    """What the page's script reads: ``replay.js`` and its neighbours."""
    sensors = [name for name in run.sensors if any(group[:2] == (scenario, name) for group in replays)]
    estimators = [name for name in run.estimators if any(group[::2] == (scenario, name) for group in replays)]
    panoramas = [pictures.place(url) for url in panoramas_of(drive, share)]
    stride = stride_of(drive, share)
    return {
        "codes": [KINDS, STATES, ACCOUNTS],
        "sensors": sensors,
        "estimators": estimators,
        "nodes": [[*node, place] for node, place in zip(drive.nodes, panoramas, strict=True)],
        "truth": drive.truth,
        "kidnapped": drive.kidnapped_at,
        "frames": [pictures.place(url) if index % stride == 0 else -1 for index, url in enumerate(drive.frames)],
        "looks": [looks[scenario, sensor] for sensor in sensors],
        "answers": [[replays.get((scenario, s, e), "not run") for e in estimators] for s in sensors],
        "commands": [[explain_command(run, scenario, (s, e), 0) for e in estimators] for s in sensors],
    }


def _player(scenario: str, drive: DriveRead, data: Mapping[str, Any], share: int) -> str:
    """The player, set to the first pair that there is something to see of."""
    seen = [(s, e) for s, line in enumerate(data["answers"]) for e, one in enumerate(line) if isinstance(one, list)]
    sensor, estimator = seen[0] if seen else (0, 0)
    return Template(asset("player.html")).substitute(
        name=escape(scenario),
        seed=drive.seed,
        kept=_kept(drive, share),
        choices=select("Sensor", data["sensors"], "sensor", sensor)
        + select("Estimator", data["estimators"], "estimator", estimator),
        speeds=options([f"{speed} frames/s" for speed in SPEEDS], SPEEDS.index(SPEED)),
        last=len(drive.truth) - 1,
        plan=plan_svg(drive, scenario),
        data=json_script("replay-data", data),
    )


def _kept(drive: DriveRead, share: int) -> str:
    """What was left out."""
    stride, told = stride_of(drive, share), []
    if stride > 1:
        told.append(f"only one of {stride} frames keeps its picture")
    if any(drive.panoramas) and not any(panoramas_of(drive, share)):
        told.append("the panoramas are left out")
    return f" To keep the page small, {' and '.join(told)}." if told else ""
