"""Splits of KTH-IDOL2: each map is one sequence, and so is each query.

unverified: the set's own papers (Pronobis, Caputo, Jensfelt, Christensen, IROS 2006; Luo, Pronobis, Caputo, Jensfelt,
IROS 2007) train on one sequence and test on one taken soon after under the same light, under another light, half a
year later, or by the other robot. Which sequences are which is as remembered: 1 and 2 soon after each other, 3 and 4
half a year later. None of their figures could be looked up.
"""

from __future__ import annotations

import re
from pathlib import Path

from topoloc.importing.public.idol2 import PICTURES
from topoloc.importing.public.levels import folders_holding
from topoloc.importing.public.splits import Pair, Split, pairs_of

LIGHTS = ("cloudy", "night", "sunny")
SEQUENCE = re.compile(r"(?:min|dum)_(?:cloudy|night|sunny)[1-4]")
SOURCE = "after Pronobis et al., IROS 2006, and Luo et al., IROS 2007"
FIGURE = "share of pictures whose room is right; no figure could be looked up"


def _split(name: str, pairs: list[tuple[str, str]]) -> Split:
    made: list[Pair] = [pair for train, query in pairs for pair in pairs_of((train,), [query])]
    return Split(name, tuple(made), SOURCE, False, FIGURE)


def _of_robot(name: str, short: str) -> list[Split]:
    """Same light soon after, other light, and half a year later."""
    return [
        _split(
            f"{name}-same-light",
            [(f"{short}_{one}{k}", f"{short}_{one}{k + 1}") for one in LIGHTS for k in (1, 3)],
        ),
        _split(
            f"{name}-other-light",
            [(f"{short}_{one}1", f"{short}_{other}1") for one in LIGHTS for other in LIGHTS if one != other],
        ),
        _split(f"{name}-half-a-year", [(f"{short}_{one}1", f"{short}_{one}3") for one in LIGHTS]),
    ]


TRANSFER = _split(
    "other-robot",
    [(f"{a}_{one}1", f"{b}_{one}1") for a, b in (("min", "dum"), ("dum", "min")) for one in LIGHTS],
)
SPLITS = {split.name: split for split in [*_of_robot("minnie", "min"), *_of_robot("dumbo", "dum"), TRANSFER]}


def find_idol2(root: Path) -> dict[str, list[Path]]:
    """The sequences below a folder, by name; one unpacked into a folder of its own name counts once."""
    found: dict[str, list[Path]] = {}
    for folder in folders_holding(root, (PICTURES,)):
        named = next((name for name in (folder.name, folder.parent.name) if SEQUENCE.fullmatch(name)), None)
        if named:
            found.setdefault(named, []).append(folder)
    return found
