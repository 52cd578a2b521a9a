"""What a tuning writes: all that was tried as a table, and the proposal as words and as TOML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from topoloc.odometry import OdometryNoise
from topoloc.settings import parse_words
from topoloc.tuning.choice import ODOMETRY, Choice
from topoloc.tuning.plan import Tuned
from topoloc.tuning.trial import TELLING

TUNE_COLUMNS = (
    *("settings", "odometry", "role", "fold"),
    *(metric.name for metric in TELLING),
    *("look_ms", "update_ms", "refused"),
)


def tune_rows(tuned: Tuned) -> Iterator[tuple[str, ...]]:
    """The rows of ``tune.csv``: each choice on each fold, in the order in which they were tried.

    ``odometry`` has the noise's settings in the order of ``OdometryNoise``, ``role`` tells which choice is the
    proposal, and which ones were made without a fold. What was refused has one row, and no values.
    """
    roles = _roles(tuned)
    for choice, outcome in tuned.outcomes.items():
        head = (str(choice), " ".join(_noise_words(choice.noise).values()), roles.get(choice, ""))
        costs = (f"{outcome.look_ms:.3f}", f"{outcome.update_ms:.3f}")
        if outcome.refused:
            yield (*head, "", *[""] * len(TELLING), "", "", outcome.refused)
            continue
        for number, fold in enumerate(tuned.folds):
            values = (outcome.metrics[metric.name][number] for metric in TELLING)
            yield (*head, fold.name, *map(_cell, values), *costs, "")


def set_words(choice: Choice) -> list[str]:
    """A choice as the words of ``topoloc localize --set``, the odometer's noise by its settings."""
    words = [f"{key}={word}" for key, word in choice.words if key != ODOMETRY]
    if choice.noise != OdometryNoise():
        words += noise_words(choice.noise)
    return words


def noise_words(noise: OdometryNoise) -> list[str]:
    """A noise as such words; those that are the default's are left out."""
    default = _noise_words(OdometryNoise())
    return [f"{ODOMETRY}.{name}={word}" for name, word in _noise_words(noise).items() if word != default[name]]


def settings_toml(tuned: Tuned) -> str:
    """``settings.toml``: the proposal by tables, commented out where it is not told from chance."""
    import tomli_w

    text = tomli_w.dumps(_typed(parse_words(set_words(tuned.proposal)))) or "# nothing: the defaults are best\n"
    if not tuned.verdict.better:
        text = "".join(f"# {line}\n" if line and line[0] != "#" else f"{line}\n" for line in text.splitlines())
    return f"# {tuned.verdict.words}\n{text}"


def _noise_words(noise: OdometryNoise) -> dict[str, str]:
    return {name: f"{value:g}" for name, value in asdict(noise).items()}


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _roles(tuned: Tuned) -> dict[Choice, str]:
    roles: dict[Choice, list[str]] = {Choice(): ["defaults"]}
    roles.setdefault(tuned.proposal, []).append("proposal")
    for fold, choice in zip(tuned.folds, tuned.held_out, strict=True):
        roles.setdefault(choice, []).append(f"without {fold.name}")
    return {choice: "; ".join(named) for choice, named in roles.items()}


def _typed(table: Mapping[str, Any]) -> dict[str, Any]:
    """Words as TOML values."""
    return {key: _typed(value) if isinstance(value, Mapping) else _value(value) for key, value in table.items()}


def _value(word: str) -> Any:
    if word in ("true", "false"):
        return word == "true"
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
