"""A choice of settings: what differs from the defaults, as a user would write it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from topoloc.odometry import OdometryNoise
from topoloc.settings import parse_words

ODOMETRY = "odometry"
"""Key of the pseudo-setting whose words are ``NOISES``."""
NOISES = {"default": 0.0, "estimated": 1.0, "estimated x 2": 2.0, "estimated x 3": 3.0}
"""Words for the odometer's noise: the defaults, or what was fitted, so many times as large. What makes the readings
likeliest need not be what a filter does best with, which takes its looks and motions for independent of each other."""
DEFAULT_NOISE = OdometryNoise()


@dataclass(frozen=True)
class Tunable:
    """A setting and the values that are tried.

    Attributes:
        key: ``sensor.slots``, ``estimator.match_threshold`` or ``odometry``.
        default: the value without tuning, as a word.
        others: the other values, as words.
        text: what it is.
    """

    key: str
    default: str
    others: tuple[str, ...]
    text: str = ""


@dataclass(frozen=True)
class Choice:
    """Settings that are tried together.

    Attributes:
        words: key and value of each setting that is not the default, in the order of the keys.
        noise: of the odometer: what the word for it stands for.
    """

    words: tuple[tuple[str, str], ...] = ()
    noise: OdometryNoise = DEFAULT_NOISE

    def changed(self, tunable: Tunable, word: str, noises: Mapping[str, OdometryNoise]) -> Choice:
        """The same with one setting at another value; ``noises`` tells what the words of ``NOISES`` stand for."""
        words = {**dict(self.words), tunable.key: word}
        if word == tunable.default:
            del words[tunable.key]
        return Choice(tuple(sorted(words.items())), noises[words.get(ODOMETRY, "default")])

    def word(self, tunable: Tunable) -> str:
        """The value that a setting has."""
        return dict(self.words).get(tunable.key, tunable.default)

    def part(self, kind: str) -> tuple[tuple[str, str], ...]:
        """The words of ``sensor`` or ``estimator`` settings."""
        return tuple((key, word) for key, word in self.words if key.startswith(f"{kind}."))

    def table(self, kind: str) -> dict[str, Any]:
        """The settings of the ``sensor`` or the ``estimator``, as ``topoloc.plugins`` takes them."""
        table: dict[str, Any] = parse_words([f"{key}={word}" for key, word in self.part(kind)]).get(kind, {})
        return table

    def __str__(self) -> str:
        return " ".join(f"{key}={word}" for key, word in self.words) or "defaults"
