"""What every importer of recordings says at its end: what was written, and what was left out and why."""

from __future__ import annotations

from pathlib import Path

from topoloc.cli.next_step import next_step
from topoloc.importing.recording_sink import Imported


def tell(output: Path, imported: Imported) -> None:
    """Print what an import wrote into a folder, what it dropped, and what to do next."""
    pictures = ", ".join(f"{count} {kind}" for kind, count in imported.frames.items())
    print(f"{output}: {pictures} pictures in {imported.seconds:.1f} s")
    print(f"odometry: {imported.odometry or 'no'} poses; ground truth: {imported.truth or 'no'} poses")
    for (what, why), count in imported.dropped.items():
        print(f"dropped: {count} x {what}: {why}")
    print(next_step("check", output))
