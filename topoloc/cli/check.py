"""``topoloc check``: what would go wrong with a map or a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def check(path: Annotated[Path, Parameter(help="Map folder, text map or recording folder.")]) -> int:
    """Look a map or a recording over: what is in it, what would go wrong, and what to do.

    Exit code 0: nothing found; 1: findings; 2: it cannot be read at all.

    Example: ``topoloc check lab/map``
    """
    from topoloc.checks import check_map, check_recording
    from topoloc.errors import InputError
    from topoloc.recording import Recording
    from topoloc.topo_map import TopoMap

    text_map = path.is_file() and path.suffix == ".txt"
    if text_map or (path / "map.toml").exists() or (path / "nodes.csv").exists():
        report = check_map(TopoMap.load(path), path)
    elif path.is_dir() and any((path / f"{kind}.txt").exists() for kind in ("rgb", "omni")):
        report = check_recording(Recording.load(path))
    elif path.is_dir():
        raise InputError(path, "is neither a map nor a recording", "a map has map.toml, a recording rgb.txt")
    else:
        problem = "is a file" if path.exists() else "no such folder"
        raise InputError(path, problem, "name a map folder or a recording folder")
    print(report.summary)
    for finding in report.findings:
        print(f"- {finding.where}: {finding.what}; {finding.remedy}")
    print("nothing found" if not report.findings else f"{len(report.findings)} findings")
    return 1 if report.findings else 0
