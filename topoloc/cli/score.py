"""``topoloc score``: a run on a public set in the terms of the papers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.importing.public.room_rate import PoseErrors, RoomRate

Row = tuple[str, str, str]
WITHIN_M = (0.5, 1.0, 5.0, 25.0)
"""Shares of frames within these distances are told; 25 m is the usual one of visual place recognition, 5 m indoors."""


def score(
    run: Annotated[Path, Parameter(help="Folder that 'topoloc localize' made, with steps.csv.")],
    pair: Annotated[Path, Parameter(help="Folder of the pair, with recording/ and node_rooms.csv.")],
) -> None:
    """Say how a run did in the terms of the papers on public sets.

    The share of frames whose room is right, frames for which no node was named counting as wrong; mean and median
    error; the share of frames within some distances. Every frame counts: one that the run has no step for is wrong,
    but has no error for the mean and median. The pair is a folder that 'topoloc import cold --split' and the like made.

    Example: ``topoloc score run scenarios/freiburg-seq2_night2-on-freiburg-seq2_cloudy3``
    """
    from rich.console import Console
    from rich.table import Table

    from topoloc.errors import InputError
    from topoloc.importing.public.answers import Answers
    from topoloc.importing.public.room_rate import NODE_ROOMS_FILE, pose_errors, room_rate
    from topoloc.importing.public.split_import import PAIR_FILE, RECORDING
    from topoloc.settings import read_toml

    recording = pair / RECORDING
    if not recording.is_dir():
        raise InputError(recording, "no such folder", "name the folder of a pair, made by 'topoloc import ... --split'")
    answers = Answers.read(run / "steps.csv", recording)
    rooms, errors = room_rate(answers, pair / NODE_ROOMS_FILE), pose_errors(answers)
    table = Table("figure", "value", "unit")
    without = ("without a step", f"{answers.missing}", f"frames of {len(answers.steps)}")
    for row in [*_room_rows(rooms), *_error_rows(errors), without]:
        table.add_row(*row)
    Console().print(table)
    if (pair / PAIR_FILE).exists():
        told = read_toml(pair / PAIR_FILE, "restore it")
        print(f"split {told.get('split', '')}: {told.get('source', '')}")
        print(f"reported there: {told.get('figure', '')}")


def _room_rows(rooms: RoomRate | None) -> Iterator[Row]:
    if rooms is None:
        return
    yield "right rooms", f"{100.0 * rooms.rate:.1f}", "%"
    for name, (pictures, right) in sorted(rooms.by_room.items()):
        yield f"  {name}", f"{100.0 * right / pictures:.1f}", f"% of {pictures}"
    yield "no node named", f"{rooms.pictures - rooms.named}", f"frames of {rooms.pictures}"


def _error_rows(errors: PoseErrors | None) -> Iterator[Row]:
    import numpy as np

    if errors is None:
        return
    for what, values, unit in (("position", errors.metres, "m"), ("heading", errors.degrees, "degrees")):
        yield f"{what}, mean", f"{np.mean(values):.3f}", unit
        yield f"{what}, median", f"{np.median(values):.3f}", unit
    for metres in WITHIN_M:
        yield f"within {metres:g} m", f"{100.0 * errors.within(metres):.1f}", "% of frames"
