"""The page."""

from __future__ import annotations

from pathlib import Path


def write_report(folder: Path) -> Path:
    """Write the report of a run's folder from what lies in it."""
    return folder / "report.html"
