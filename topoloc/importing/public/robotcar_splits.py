"""Splits of the Oxford RobotCar, and where its traversals lie on a disk."""

from __future__ import annotations

import re
from pathlib import Path

from topoloc.importing.public.levels import folders_holding
from topoloc.importing.public.robotcar import INSIDE
from topoloc.importing.public.splits import Split, pairs_of

TRAVERSAL = re.compile(r"\d{4}(?:-\d\d){5}")
LOOP_TRAIN = ("2014-06-26-08-53-56", "2014-06-26-09-24-58")

LOOP = Split(
    "loop",
    pairs_of(LOOP_TRAIN, ["2014-06-23-15-36-04", "2014-06-23-15-41-25"]),
    "Brahmbhatt, Gu, Kim, Hays, Kautz: MapNet, CVPR 2018, scene loop; the traversals lie in its data folder, which are "
    "train and which test is seen in a loader of others",
    True,
    "mean error, README of geomapnet: MapNet 9.84 m, 3.96 degrees; MapNet++ 6.95 m, 2.38; with pose graph 6.74 m, 2.23",
)
FULL = Split(
    "full",
    pairs_of(("2014-11-28-12-07-13", "2014-12-02-15-30-08"), ["2014-12-09-13-21-02"]),
    "Brahmbhatt et al.: MapNet, CVPR 2018, scene full; as for loop",
    True,
    "mean error in metres and degrees; no figure could be looked up",
)
ALTERNATE = Split(
    "alternate",
    pairs_of(LOOP_TRAIN, ["2014-06-23-15-41-25"]),
    "Doan, Latif, Do, Liu, Ch'ng, Chin, Reid: Visual Localization Under Appearance Change, DICTA 2019, README: route "
    "alternate (1 km); which one is the query is read from the dates",
    True,
    "mean and median error in metres and degrees; no figure could be looked up",
)
SPLITS = {split.name: split for split in (LOOP, FULL, ALTERNATE)}


def find_robotcar(root: Path) -> dict[str, list[Path]]:
    """The traversals below a folder, by name."""
    found: dict[str, list[Path]] = {}
    for folder in folders_holding(root, INSIDE):
        if TRAVERSAL.fullmatch(folder.resolve().name):
            found.setdefault(folder.resolve().name, []).append(folder)
    return found
