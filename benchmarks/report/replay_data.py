"""What the replay embeds in the page, and what it leaves out so that the page can be opened.

Pictures: every scenario may take the same share; where its frames need more, only every k-th is kept. Looks and
answers: what a scenario leaves of its share goes to those that need more. First come the pairs of the question, then
the sensors in turn, each with its best pair there that is not kept yet.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, zip_longest
from typing import Any

from benchmarks.report.compact import answers_of, looks_of
from benchmarks.report.comparisons import QUESTION
from benchmarks.report.headline import known_of
from benchmarks.report.markup import pair_name
from benchmarks.report.replay_files import BROKEN, DriveRead, Unreadable, read_json
from benchmarks.report.run_read import RunRead
from benchmarks.results import OK
from benchmarks.run_files import answers_path, looks_path
from benchmarks.spread import Pair

PICTURES_BYTES, ANSWERS_BYTES = 9_000_000, 6_000_000
LEFT_OUT = (
    f"left out, or the page would be too large; {' and '.join(map(pair_name, QUESTION))} come first, then the sensors "
    "in turn, each with those of its pairs that have the highest node accuracy on this scenario"
)


@dataclass(frozen=True)
class Shown:
    """What the replay shows of a scenario.

    Attributes:
        looks: what each sensor saw, compact; without those that have no room or cannot be read.
        answers: what each pair answered, compact, or why it cannot be shown.
    """

    looks: Mapping[str, list[Any]]
    answers: Mapping[Pair, list[Any] | str]


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


def read_shown(run: RunRead, drives: Mapping[str, DriveRead]) -> dict[str, Shown]:
    """Looks and answers of the drives that are shown, by scenario, as far as there is room."""
    found: dict[str, Shown] = {}
    room = ANSWERS_BYTES
    for scenario in sorted(drives, key=lambda name: len(drives[name].frames)):  # what short ones leave, long ones get
        share = room // (len(drives) - len(found))
        found[scenario], taken = _shown(run, scenario, drives[scenario], share)
        room -= taken
    return found


def in_turn(run: RunRead, scenario: str) -> list[Pair]:
    """The pairs that ran on the drive that is shown, those that are kept first at the head."""
    ran = {row.key[1:3] for row in run.rows if (row.scenario, row.seed) == (scenario, run.choice.first_seed)}
    means = {
        pair: statistics.fmean(own[scenario].values())
        for pair, own in known_of(row for row in run.rows if row.scenario == scenario).items()
    }
    ranked = sorted((pair for pair in run.pairs if pair in ran), key=lambda pair: -means.get(pair, -1.0))
    of_sensor: dict[str, list[Pair]] = {}
    for pair in ranked:
        of_sensor.setdefault(pair[0], []).append(pair)
    rounds = chain.from_iterable(zip_longest(*of_sensor.values()))
    return list(dict.fromkeys([*(pair for pair in QUESTION if pair in ran), *filter(None, rounds)]))


def _shown(run: RunRead, scenario: str, drive: DriveRead, room: int) -> tuple[Shown, int]:
    """What a scenario shows in so much room [bytes], and how much of it that takes."""
    bad = {row.key: f"{row.status}: {row.reason}" for row in run.rows if row.status != OK}
    looks: dict[str, list[Any]] = {}
    answers: dict[Pair, list[Any] | str] = {}
    taken = 0
    for pair in in_turn(run, scenario):
        why = bad.get((scenario, *pair, run.choice.first_seed)) or (LEFT_OUT if taken >= room else "")
        if why:
            answers[pair] = why
            continue
        if pair[0] not in looks:
            looks[pair[0]] = _looks(run, scenario, pair[0])
            taken += _size_of(looks[pair[0]])
        answers[pair] = _answers(run, scenario, pair, drive)
        taken += _size_of(answers[pair])
    return Shown(looks, answers), taken


def _size_of(value: Any) -> int:
    """Bytes that a value takes in the page."""
    return len(json.dumps(value, separators=(",", ":")))


def _looks(run: RunRead, scenario: str, sensor: str) -> list[Any]:
    try:
        return looks_of(read_json(run.folder, looks_path(scenario, sensor)))
    except (Unreadable, *BROKEN):
        return []


def _answers(run: RunRead, scenario: str, pair: Pair, drive: DriveRead) -> list[Any] | str:
    path = answers_path(scenario, *pair)
    try:
        return answers_of(read_json(run.folder, path), drive.near)
    except Unreadable as error:
        return str(error)
    except BROKEN:
        return f"{path}: does not hold answers"
