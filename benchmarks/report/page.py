"""The page: its sections, styles and scripts put into one file that needs no other."""

from __future__ import annotations

from html import escape
from pathlib import Path
from string import Template

from benchmarks.report.comparisons import comparisons_section
from benchmarks.report.definitions import definitions_table, notice, problems, settings
from benchmarks.report.error_curves import error_section
from benchmarks.report.headline import headline_of
from benchmarks.report.headline_section import headline_section
from benchmarks.report.markup import asset
from benchmarks.report.reliability import reliability_section
from benchmarks.report.replay_files import DriveRead, Unreadable, read_drive
from benchmarks.report.replay_section import replay_section
from benchmarks.report.run_read import RunRead
from benchmarks.report.scenario_tables import tables_section
from topoloc.files import write_text

SCRIPTS = ("page.js", "tables.js", "comparisons.js", "charts.js", "plan.js", "looks.js", "replay.js")
"""In the order in which one needs the other."""


def write_report(folder: Path) -> Path:
    """Write ``report.html`` into a run's folder, from what lies there; the run may be unfinished.

    Raises:
        InputError: the folder is no run's.
        UserError: the file cannot be written.
    """
    path = folder / "report.html"
    write_text(path, report_html(RunRead.of(folder)))
    return path


def report_html(run: RunRead) -> str:
    """The page."""
    headline = headline_of(run.rows, [name for name in run.scenarios if run.recorded(name)])
    drives = {scenario: _drive(run.folder, scenario) for scenario in run.scenarios}
    kidnapped = {name: drive.kidnapped_at for name, drive in drives.items() if isinstance(drive, DriveRead)}
    started = run.config.get("run", {}).get("started", "at an unknown time")
    return Template(asset("page.html")).substitute(
        style=asset("style.css"),
        script="\n".join(asset(name) for name in SCRIPTS),
        state=escape(run.state),
        started=escape(str(started)),
        notice=notice(run),
        headline=headline_section(run, headline),
        comparisons=comparisons_section(run, headline),
        values="Mean over seeds and its interval." if run.choice.seeds > 1 else "Values of the one seed.",
        tables=tables_section(run),
        problems=problems(run),
        reliability=reliability_section(run),
        errors=error_section(run, kidnapped),
        replay=replay_section(run, drives),
        definitions=definitions_table(),
        command=escape(run.choice.command),
        settings=settings(run),
    )


def _drive(folder: Path, scenario: str) -> DriveRead | str:
    """The drive that is shown of a scenario, or why it cannot be."""
    try:
        return read_drive(folder, scenario)
    except Unreadable as error:
        return str(error)
