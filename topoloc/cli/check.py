"""``topoloc check``: what would go wrong with a map, a recording, or the two together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.checks import Report
    from topoloc.recording import Recording
    from topoloc.topo_map import TopoMap


def check(
    path: Annotated[Path, Parameter(help="Map folder, text map or recording folder.")],
    recording: Annotated[
        Path | None, Parameter(help="Recording that is to be localized on the map: both, and whether they suit.")
    ] = None,
    *,
    fail_on: Annotated[
        Literal["note", "warning", "serious"], Parameter(help="Findings from here on make the exit code 1.")
    ] = "warning",
    json: Annotated[bool, Parameter(help="Print one JSON object instead.", negative="")] = False,
) -> int:
    """Look a map or a recording over, or both together: what is in it, what would go wrong, and what to do.

    Each finding says where, what, what to do, and how bad it is: serious makes answers wrong, warning makes them worse,
    a note is worth knowing. Pictures are held against each other, so that a large map takes some minutes.

    Exit code 0: nothing found but notes; 1: findings; 2: it cannot be read at all.

    Example: ``topoloc check lab/map lab/recording``
    """
    from topoloc.checks import check_map, check_pair, check_recording
    from topoloc.errors import InputError
    from topoloc.topo_map import TopoMap

    first = _open(path)
    second = None if recording is None else _open(recording)
    if second is None:
        reports = [check_map(first, path, _track) if isinstance(first, TopoMap) else check_recording(first, _track)]
    elif isinstance(first, TopoMap) and not isinstance(second, TopoMap):
        reports = [check_map(first, path, _track), check_recording(second, _track), check_pair(first, second, _track)]
    else:
        raise InputError(recording or path, "is not the recording of a map", "name the map first, then its recording")
    _print(reports, json)
    found = any(report.at_least(fail_on) for report in reports)
    if not (found or json or recording):
        print(_next(first, path))
    return 1 if found else 0


def _next(looked_at: TopoMap | Recording, path: Path) -> str:
    """What to do with a map or a recording that nothing is wrong with."""
    from topoloc.cli.next_step import next_step
    from topoloc.topo_map import TopoMap

    if isinstance(looked_at, TopoMap):
        return next_step("localize", path, "RECORDING", "-o", "run")
    return next_step("map", "build", path, "-o", "map")


def _open(path: Path) -> TopoMap | Recording:
    """The map or the recording that lies there. Raises ``InputError`` for what is neither."""
    from topoloc.errors import InputError
    from topoloc.recording import Recording
    from topoloc.topo_map import TopoMap

    text_map = path.is_file() and path.suffix == ".txt"
    if text_map or (path / "map.toml").exists() or (path / "nodes.csv").exists():
        return TopoMap.load(path)
    if path.is_dir() and any((path / f"{kind}.txt").exists() for kind in ("rgb", "omni")):
        return Recording.load(path)
    if path.is_dir():
        raise InputError(path, "is neither a map nor a recording", "a map has map.toml, a recording rgb.txt")
    problem = "is a file" if path.exists() else "no such folder"
    raise InputError(path, problem, "name a map folder or a recording folder")


def _track(numbers: Sequence[int], what: str) -> Iterator[int]:
    from topoloc.cli.progress import track

    return track(numbers, what)


def _print(reports: Sequence[Report], as_json: bool) -> None:
    """Summaries and findings, the worst first."""
    from dataclasses import asdict
    from json import dumps

    from topoloc.checks import SEVERITIES

    if as_json:
        print(dumps([asdict(report) for report in reports], indent=2))
        return
    for report in reports:
        print(report.summary)
        for finding in sorted(report.findings, key=lambda one: -SEVERITIES.index(one.severity)):
            print(f"- {finding.severity}: {finding.where}: {finding.what}; {finding.remedy}")
    count = sum(len(report.findings) for report in reports)
    print("nothing found" if count == 0 else f"{count} finding{'' if count == 1 else 's'}")
