"""The command lines that repeat a row of the tables, or say why one of its steps came out as it did."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from html import escape
from pathlib import PurePath

from benchmarks.report.markup import pair_name, plural
from benchmarks.report.run_read import RunRead
from benchmarks.spread import Pair

SHOWN_STEP = 12


def explain_command(run: RunRead, scenario: str, pair: Pair, step: int = SHOWN_STEP) -> str:
    """Says why a step of a pair's first run came out as it did."""
    folder = run.folder.name if run.folder.is_absolute() else str(run.folder)
    words = ["topoloc", "explain", PurePath(folder).as_posix(), "--scenario", scenario, "--sensor", pair[0]]
    words += ["--estimator", pair[1], "--seed", str(run.choice.first_seed), "--step", str(step)]
    return shlex.join(words)


def commands_of(run: RunRead, scenario: str, pairs: Sequence[Pair]) -> str:
    """Both commands of each pair of a scenario, folded away."""
    rows = "".join(
        f'<tr><th scope="row">{escape(pair_name(pair))}</th><td>{_copied(run.command(scenario, pair))}'
        f"{_copied(explain_command(run, scenario, pair))}</td></tr>"
        for pair in pairs
    )
    return (
        f"<details><summary>How to reproduce each row of {escape(scenario)} ({plural(len(pairs), 'pair')})</summary>"
        '<p class="note">The first command runs the row again, with the same seeds; the second says why one step came '
        "out as it did: steps count frames from 0. Type it where this run's folder lies.</p>"
        f'<table class="commands"><tbody>{rows}</tbody></table></details>'
    )


def _copied(command: str) -> str:
    button = '<button type="button" data-role="copy">Copy</button>'
    return f'<div class="command"><code>{escape(command)}</code>{button}</div>'
