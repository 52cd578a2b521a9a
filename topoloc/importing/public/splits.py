"""Splits of public sets: which sequences the map is made of, and which are localized on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from topoloc.errors import UnknownName, UserError


@dataclass(frozen=True)
class Pair:
    """One map, one drive on it.

    Attributes:
        name: of the pair; a folder is called so.
        train: sequences that the map is made of.
        query: the sequence that is localized.
    """

    name: str
    train: tuple[str, ...]
    query: str


@dataclass(frozen=True)
class Split:
    """Pairs that somebody reports on.

    Attributes:
        name: of the split.
        pairs: of it.
        source: who reports on it.
        verified: the source was looked up; else it is as remembered.
        figure: what is reported, and how much it is where that could be looked up.
    """

    name: str
    pairs: tuple[Pair, ...]
    source: str
    verified: bool
    figure: str

    @property
    def sequences(self) -> tuple[str, ...]:
        """All sequences, each once, those of maps first."""
        named = [name for pair in self.pairs for name in pair.train] + [pair.query for pair in self.pairs]
        return tuple(dict.fromkeys(named))


def pairs_of(train: Sequence[str], queries: Sequence[str]) -> tuple[Pair, ...]:
    """A pair for each query on one map; names tell both, ``/`` written as ``-``."""
    told = "+".join(train).replace("/", "-")
    return tuple(Pair(f"{query.replace('/', '-')}-on-{told}", tuple(train), query) for query in queries)


def choose(splits: Mapping[str, Split], name: str) -> Split:
    """A split by name. Raises ``UnknownName``."""
    if name not in splits:
        raise UnknownName("split", name, sorted(splits))
    return splits[name]


def find(split: Split, root: Path, found: Mapping[str, Sequence[Path]]) -> dict[str, Path]:
    """Where each sequence of a split lies.

    Args:
        split: whose sequences are wanted.
        root: where they were looked for.
        found: the folders of each sequence, by name.

    Raises:
        UserError: one line that names all that are missing, or one that lies there twice.
    """
    missing = [name for name in split.sequences if not found.get(name)]
    if missing:
        _refuse_missing(split, root, missing)
    for name in split.sequences:
        if len(found[name]) > 1:
            raise UserError(f"{root}: {name} lies there twice, {found[name][0]} and {found[name][1]}; move one away")
    return {name: found[name][0] for name in split.sequences}


def _refuse_missing(split: Split, root: Path, missing: Sequence[str]) -> NoReturn:
    lacking = f"{len(missing)} of {len(split.sequences)} sequences of split {split.name} are missing"
    raise UserError(f"{root}: {lacking}: {', '.join(missing)}; unpack them below this folder, or take another split")
