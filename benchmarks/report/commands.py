"""Command lines: those that repeat a row of the tables, say why a frame came out so, or make the run tell more."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from html import escape

from benchmarks.report.markup import pair_name, plural
from benchmarks.report.run_read import RunRead
from benchmarks.spread import FEWEST_PAIRS, Pair

SHOWN_FRAME = 12
ENOUGH_SEEDS = 10
"""From eight seeds on the intervals nearly keep their 95 % (``benchmarks.spread``)."""


def explain_command(run: RunRead, scenario: str, pair: Pair, frame: int = SHOWN_FRAME) -> str:
    """Says why a frame of a pair's first run came out as it did, wherever it is typed."""
    words = ["topoloc", "explain", str(run.folder.resolve()), "--scenario", scenario, "--sensor", pair[0]]
    words += ["--estimator", pair[1], "--seed", str(run.choice.first_seed), "--step", str(frame)]
    return shlex.join(words)


def advice(run: RunRead) -> str:
    """What to run so that the report can tell more; empty where nothing would help."""
    if run.missing:
        return f"<p>The run is unfinished. To go on with it:</p>{copied(_resume_command(run))}"
    if run.choice.seeds >= FEWEST_PAIRS or all(map(run.recorded, run.scenarios)):
        return ""
    return f"<p>To tell pairs apart:</p>{copied(replace(run.choice, seeds=ENOUGH_SEEDS).command)}"


def commands_of(run: RunRead, scenario: str, pairs: Sequence[Pair]) -> str:
    """Both commands of each pair of a scenario, folded away."""
    rows = "".join(
        f'<tr><th scope="row">{escape(pair_name(pair))}</th><td>{copied(run.command(scenario, pair))}'
        f"{copied(explain_command(run, scenario, pair))}</td></tr>"
        for pair in pairs
    )
    return (
        f"<details><summary>How to reproduce each row of {escape(scenario)} ({plural(len(pairs), 'pair')})</summary>"
        '<p class="note">The first command runs the row again, with the same seeds; the second says why one frame '
        "came out as it did: its --step is the number of the frame, from 0.</p>"
        f'<table class="commands"><tbody>{rows}</tbody></table></details>'
    )


def copied(command: str) -> str:
    """A command with a button that copies it."""
    button = '<button type="button" data-role="copy">Copy</button>'
    return f'<div class="command"><code>{escape(command)}</code>{button}</div>'


def _resume_command(run: RunRead) -> str:
    return shlex.join(["topoloc", "bench", "--resume", str(run.folder.resolve())])
