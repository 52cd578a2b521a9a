"""The dated report of a run as Markdown; every figure in it is computed from the run's rows."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.publish.costs import costs
from benchmarks.publish.overall import overall
from benchmarks.publish.published import Published
from benchmarks.publish.question import question
from benchmarks.publish.scenario_part import scenario_part
from benchmarks.results import OK, Row
from benchmarks.spread import FEWEST_PAIRS


def report_of(published: Published, timed: Published) -> str:
    """The report, with times from one run and all else from another, or the same."""
    parts = (
        f"# Benchmark of {published.date}",
        _drives(published),
        _about(published),
        "## Which pair is right how often",
        _how_to_read(published),
        overall(published),
        *(scenario_part(published, name) for name in published.names("scenarios")),
        "## IMA with the activity tracker, or PCA with particles?",
        question(published),
        "## What a step costs",
        costs(timed),
        "## What did not run",
        _missing(published.run.rows),
    )
    return "\n\n".join(parts) + "\n"


def _drives(published: Published) -> str:
    """Which drives are simulated and which are recorded, how many and how long they are."""
    choice, names = published.choice, published.names("scenarios")
    recorded = [name for name in names if published.run.recorded(name)]
    simulated = [name for name in names if name not in recorded]
    seeds = f"{choice.seeds} seeds from {choice.first_seed} on"
    told = []
    if simulated:
        which = f"The drives of {', '.join(simulated)} are" if recorded else "All drives are"
        told.append(f"{which} **simulated**. {seeds}, {choice.updates} frames a drive{_longer(published, simulated)}.")
    if recorded:
        which = "are **recorded**, one drive each" if len(recorded) > 1 else "is one **recorded** drive"
        told.append(f"{', '.join(recorded)} {which}; seeds there ({seeds}) are the estimators' random numbers alone.")
    return " ".join((*told, "One thread a process. Settings are the defaults unless told."))


def _longer(published: Published, simulated: Iterable[str]) -> str:
    """`` (twins: 120)``, where a scenario stretches its drives."""
    frames = {name: published.run.table("scenarios", name).get("updates") for name in simulated}
    usual = (None, published.choice.updates)
    others = [f"{name}: {count}" for name, count in frames.items() if count not in usual]
    return f" ({', '.join(others)})" if others else ""


def _about(published: Published) -> str:
    """Machine, versions, and how to have it again."""
    machine, versions = published.machine, published.run.table("versions")
    memory = f", {machine['memory_gb']:.0f} GB" if "memory_gb" in machine else ""
    processor = machine["processor"] or "unknown processor"
    return (
        f"- Machine: {processor}, {machine['cores']} cores{memory}, {machine['system']}\n"
        f"- Versions: {', '.join(f'{name} {version}' for name, version in versions.items())}\n"
        f"- The same again: `{published.choice.command}`, then `python -m benchmarks.publish RUN`\n"
        "- What the words mean: [metrics](../metrics.md), [scenarios and intervals](../benchmark.md)"
    )


def _how_to_read(published: Published) -> str:
    if published.choice.seeds < FEWEST_PAIRS:
        return f"Node accuracy in %, mean over the seeds. Fewer than {FEWEST_PAIRS} seeds tell no differences."
    return (
        "Node accuracy in %, mean over the seeds, and its 95 % interval. **Bold**: the highest mean, and what cannot "
        "be told apart from it; the others are worse, by an interval of paired differences that excludes zero. It "
        "knows that the best was picked among all: a rival that scatters widely (`kalman` often) hides differences."
    )


def _missing(rows: Iterable[Row]) -> str:
    """Each reason once, with what it held up."""
    reasons: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        if row.status != OK:
            reasons.setdefault((row.status, row.reason), set()).add(f"`{row.sensor}` on {row.scenario}")
    lines = [f"- {status}: {reason} ({', '.join(sorted(who))})" for (status, reason), who in reasons.items()]
    return "\n".join(lines) or "Everything ran."
