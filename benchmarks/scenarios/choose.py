"""Scenarios by name: the benchmark's own, or a folder of somebody's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.scenarios.case import Scenario
from benchmarks.scenarios.recorded import recorded
from benchmarks.scenarios.simulated import SUITE, simulated
from topoloc.errors import UnknownName
from topoloc.plugins import SCENARIOS, names
from topoloc.settings import refuse_unknown

DEFAULT = ("lab-fresh", "lab-people", "lab-kidnapped")
"""What is run where nothing is named."""
OR_A_FOLDER = "or a folder with map/ and recording/ in it"


def scenario_names() -> tuple[str, ...]:
    """Names of the benchmark's own scenarios, then of others' that are installed."""
    return (*SUITE, *(name for name in names(SCENARIOS) if name not in SUITE))


def make_scenario(name: str, updates: int = 60, settings: Mapping[str, Any] | None = None) -> Scenario:
    """A scenario by name.

    Args:
        name: one of ``scenario_names()``, or else a folder with a map and a recording in it: see ``recorded``.
        updates: frames of a drive that is simulated; a recorded one has the frames that it has.
        settings: of its world, in place of the scenario's own; a recorded one takes none.

    Raises:
        UserError: nothing is called so, the settings do not suit it, or a file of its folder cannot be used.
    """
    if name in scenario_names():
        return simulated(name, updates, settings or {})
    if not Path(name).is_dir():
        raise UnknownName("scenario", name, [*sorted(scenario_names()), OR_A_FOLDER])
    refuse_unknown(settings or {}, set(), f"settings of {name}, which is recorded")
    return recorded(Path(name))
