"""A large map on disk: two files a building, so that making it can be broken off and gone on with."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.large_map.making import ON, LargeMap, Part, Plan, Progress, Seen
from topoloc.errors import InputError
from topoloc.files import read_text, write_bytes, write_text

PLAN_FILE = "plan.json"
PARTS, ON_NODES = "parts/{:04d}.npz", "parts/{:04d}-on-nodes.npz"
"""Panoramas of a building and what is seen off its nodes, and what is seen on them."""
Kind = TypeVar("Kind", bound=Seen)
REMEDY = "make the map with 'python -m benchmarks.large_map make'"


def make_in(folder: Path, plan: Plan, progress: Progress) -> None:
    """Make what is not in the folder yet.

    Args:
        folder: made where it does not exist.
        plan: of the map; a folder that was begun with another one is left alone.
        progress: told how many nodes more are done.

    Raises:
        InputError: the folder holds another map.
    """
    path = folder / PLAN_FILE
    if not path.exists():
        write_text(path, json.dumps(asdict(plan)) + "\n")
    elif _plan_of(folder) != plan:
        raise InputError(path, f"is of another map, {_plan_of(folder)}", "name another folder, or delete this one")
    for number, site in enumerate(plan.sites):
        if (folder / PARTS.format(number)).exists():
            progress(site.count)
        else:
            keep(folder / PARTS.format(number), plan.make(site, progress))
        if not (folder / ON_NODES.format(number)).exists():
            keep(folder / ON_NODES.format(number), plan.seen(site, ON))


def keep(path: Path, part: Seen) -> None:
    """Write what one building adds, or what is seen on its nodes."""
    buffer = io.BytesIO()
    np.savez(buffer, **vars(part))
    write_bytes(path, buffer.getvalue())


def load(folder: Path) -> LargeMap:
    """The map in a folder.

    Raises:
        InputError: the folder holds no map, or one that is not finished.
    """
    plan = _plan_of(folder)
    numbers = range(len(plan.sites))
    return plan.assemble(
        [_kept(Part, folder / PARTS.format(number)) for number in numbers],
        [_kept(Seen, folder / ON_NODES.format(number)) for number in numbers],
    )


def _plan_of(folder: Path) -> Plan:
    path = folder / PLAN_FILE
    try:
        return Plan(**json.loads(read_text(path, REMEDY)))
    except (TypeError, ValueError):
        raise InputError(path, "is no plan of a large map", REMEDY) from None


def _kept(kind: type[Kind], path: Path) -> Kind:
    try:
        with np.load(path, allow_pickle=False) as held:
            return kind(**held)
    except FileNotFoundError:
        raise InputError(path, "no such file: the map is not finished", "go on with the same 'make' command") from None
    except (OSError, ValueError, TypeError, KeyError):
        raise InputError(path, "is no part of a large map", "delete it and go on with 'make'") from None
