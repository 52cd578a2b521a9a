"""The replay: for each scenario a player, with a plan, pictures and tables that the page's script moves."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from string import Template
from typing import Any

from benchmarks.report import replay_data
from benchmarks.report.commands import explain_command
from benchmarks.report.compact import ACCOUNTS, KINDS, STATES, VERDICTS
from benchmarks.report.markup import asset, json_script, options, select
from benchmarks.report.plan import plan_svg
from benchmarks.report.replay_data import Pictures, Shown, panoramas_of, read_shown, stride_of
from benchmarks.report.replay_files import DriveRead
from benchmarks.report.run_read import RunRead

SPEEDS, SPEED = (1, 2, 4, 8), 2
"""That can be chosen, and the first one [frames/s]."""


def replay_section(run: RunRead, drives: Mapping[str, DriveRead | str]) -> str:
    """A player for each scenario.

    Args:
        run: the run.
        drives: by scenario, or why there is none.
    """
    kept = {name: drive for name, drive in drives.items() if isinstance(drive, DriveRead)}
    shown = read_shown(run, kept)
    pictures = Pictures([], {})
    share = replay_data.PICTURES_BYTES // max(len(kept), 1)
    players = []
    for scenario in run.scenarios:
        drive = drives[scenario]
        if not isinstance(drive, DriveRead):
            players.append(_none(scenario, f"No replay: {drive}."))
        elif not shown[scenario].answers:
            players.append(_none(scenario, "No run on the drive that is shown has ended."))
        else:
            data = _data(run, scenario, drive, shown[scenario], pictures, share)
            players.append(_player(scenario, drive, data, share))
    return "".join(players) + json_script("pictures", pictures.urls)


def _none(scenario: str, why: str) -> str:
    return f"<section><h3>{escape(scenario)}</h3><p>{escape(why)}</p></section>"


def _data(
    run: RunRead, scenario: str, drive: DriveRead, shown: Shown, pictures: Pictures, share: int
) -> dict[str, Any]:
    """What the page's script reads: ``replay.js`` and its neighbours."""
    sensors = [name for name in run.sensors if any(pair[0] == name for pair in shown.answers)]
    estimators = [name for name in run.estimators if any(pair[1] == name for pair in shown.answers)]
    panoramas = [pictures.place(url) for url in panoramas_of(drive, share)]
    stride = stride_of(drive, share)
    return {
        "codes": [KINDS, STATES, ACCOUNTS, VERDICTS],
        "sensors": sensors,
        "estimators": estimators,
        "nodes": [[*node, place] for node, place in zip(drive.nodes, panoramas, strict=True)],
        "truth": drive.truth,
        "kidnapped": drive.kidnapped_at,
        "frames": [pictures.place(url) if index % stride == 0 else -1 for index, url in enumerate(drive.frames)],
        "looks": [shown.looks.get(sensor, []) for sensor in sensors],
        "answers": [[shown.answers.get((s, e), "not run") for e in estimators] for s in sensors],
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
