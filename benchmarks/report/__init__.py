"""``report.html``: one file that says what a benchmark run found; opens from disk, needs nothing else."""

from benchmarks.report.page import write_report

__all__ = ["write_report"]
