"""What the replay embeds in the page, and what it leaves out so that the page can be opened.

Pictures: every scenario may take the same share; where its frames need more, only every k-th is kept. Looks and
answers: sensors in their order, up to half of the room, then pairs from the highest mean node accuracy down, as many
as there is room for.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.report.compact import answers_of, looks_of
from benchmarks.report.replay_files import BROKEN, DriveRead, Unreadable, read_json
from benchmarks.report.run_read import RunRead
from benchmarks.results import OK
from benchmarks.run_files import answers_path, looks_path
from benchmarks.spread import Group, Pair

PICTURES_BYTES, ANSWERS_BYTES = 9_000_000, 6_000_000

Looks = Mapping[tuple[str, str], list[Any]]
"""What each sensor saw on each scenario, compact."""
Replays = Mapping[Group, list[Any] | str]
"""What each pair answered, compact, or why it cannot be shown."""


@dataclass(frozen=True)
class Pictures:
    """Pictures of all scenarios, each once, as data URLs.

    Attributes:
        urls: the pictures.
        places: index of each.
    """

    urls: list[str]
    places: dict[str, int]

    def place(self, url: str) -> int:
        """Index of a picture, kept from now on; -1 of none."""
        if not url:
            return -1
        if url not in self.places:
            self.places[url] = len(self.urls)
            self.urls.append(url)
        return self.places[url]


def panoramas_of(drive: DriveRead, share: int) -> list[str]:
    """Of the nodes, or none, where they alone would take more bytes than the scenario may."""
    return drive.panoramas if sum(map(len, drive.panoramas)) <= share else [""] * len(drive.nodes)


def stride_of(drive: DriveRead, share: int) -> int:
    """Every so manieth frame keeps its picture: as many as fit beside the panoramas, but at least some."""
    room = max(share - sum(map(len, panoramas_of(drive, share))), share // 4)
    return max(1, math.ceil(sum(map(len, drive.frames)) / room))


def read_looks(run: RunRead, scenarios: Sequence[str]) -> Looks:
    """What each sensor saw on the drives that are shown, as far as there is room; empty where it cannot be read."""
    found: dict[tuple[str, str], list[Any]] = {}
    room = ANSWERS_BYTES // 2
    for sensor in run.sensors:
        for scenario in scenarios:
            found[scenario, sensor] = _looks(run, scenario, sensor) if room > 0 else []
            room -= size_of(found[scenario, sensor])
    return found


def read_replays(run: RunRead, scenarios: Sequence[str], ranked: Sequence[Pair], room: int) -> Replays:
    """What each pair answered on the drives that are shown, as far as there is room [bytes]."""
    found: dict[Group, list[Any] | str] = {}
    seed = run.choice.first_seed
    bad = {row.key: f"{row.status}: {row.reason}" for row in run.rows if row.status != OK}
    ran = {row.key for row in run.rows}
    for pair in [*ranked, *(pair for pair in run.pairs if pair not in ranked)]:
        for scenario in scenarios:
            key = (scenario, *pair, seed)
            if key in ran:
                found[scenario, *pair] = bad.get(key) or _answers(run, scenario, pair, room)
                room -= size_of(found[scenario, *pair])
    return found


def size_of(value: Any) -> int:
    """Bytes that a value takes in the page."""
    return len(json.dumps(value, separators=(",", ":")))


def _looks(run: RunRead, scenario: str, sensor: str) -> list[Any]:
    try:
        return looks_of(read_json(run.folder, looks_path(scenario, sensor)))
    except (Unreadable, *BROKEN):
        return []


def _answers(run: RunRead, scenario: str, pair: Pair, room: int) -> list[Any] | str:
    if room <= 0:
        return "left out, or the page would be too large: pairs with a higher mean come first"
    path = answers_path(scenario, *pair)
    try:
        return answers_of(read_json(run.folder, path))
    except Unreadable as error:
        return str(error)
    except BROKEN:
        return f"{path}: does not hold answers"
