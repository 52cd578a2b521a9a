"""``topoloc run``: localize a robot while it drives, from a camera; or a video or a recording as if it were one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.live_setup import LiveChoice, live_localizer, stopped_by_signals
from topoloc.cli.localize import SETTINGS_HELP

if TYPE_CHECKING:
    from topoloc.live import LiveLocalizer, LiveReport
    from topoloc.live.feeds import Feed
    from topoloc.live.run_log import RunLog
    from topoloc.live.sources import Source
    from topoloc.topo_map import TopoMap

ODOMETRY_HELP = (
    "FILE.csv for a video, columns such as time_s,x_m,y_m,heading_deg, times since its first picture; '-': "
    "'time x y theta' lines on standard input, or such columns, for a camera in Unix time; none. "
    "A recording has its own."
)
TELL_EVERY_S = 1.0
"""Where lines are not rewritten, one so often, and at every change of status or place [s]."""


def run(
    topo_map: Annotated[Path, Parameter(name="map", help="Map folder, or a text map.")],
    *,
    camera: Annotated[str | None, Parameter(help="Number of a camera, or its device: 0, /dev/video0.")] = None,
    video: Annotated[Path | None, Parameter(help="Video file, played at its own pace.")] = None,
    recording: Annotated[Path | None, Parameter(help="Recording folder, played at its own pace.")] = None,
    odometry: Annotated[str | None, Parameter(help=ODOMETRY_HELP, allow_leading_hyphen=True)] = None,
    offset_s: Annotated[float, Parameter(help="Time of a video's first picture on the clock of --odometry.")] = 0.0,
    fast: Annotated[bool, Parameter(help="Play as fast as it goes, nothing dropped.", negative="")] = False,
    camera_toml: Annotated[Path | None, Parameter(help="Lens, size and mount of a camera or a video.")] = None,
    sensor: Annotated[str, Parameter(help="See 'topoloc list sensors'; several as one: a+b, 'mix(a,b)'.")] = "ima",
    estimator: Annotated[str, Parameter(help="See 'topoloc list estimators'.")] = "activity",
    seed: Annotated[int, Parameter(help="Of the estimator's random numbers.", validator=Number(gte=0))] = 0,
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", help=f"{SETTINGS_HELP} Of the live run itself: live.KEY=VALUE.")
    ] = (),
    rate: Annotated[
        float | None,
        Parameter(help="At most so many pictures a second; others are passed over.", validator=Number(gt=0)),
    ] = None,
    state: Annotated[Path | None, Parameter(help="File that keeps the belief; if it is there, start from it.")] = None,
    log: Annotated[Path | None, Parameter(help="Folder to make: trajectory.txt, steps.csv.")] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the files of an earlier log.", negative="")] = False,
    json: Annotated[bool, Parameter(help="Print a JSON object a line for each picture.", negative="")] = False,
) -> None:
    """Localize a robot while it drives.

    Pictures that come while the last one is worked on are dropped, all but the youngest. A line tells place, pose,
    probability, status and how many were dropped. Without a new picture for two seconds the status is LOST. Ctrl-C
    ends it: belief and log are written first.

    Example: ``topoloc run lab/map --camera 0 --state lab.belief``
    """
    from contextlib import closing

    from topoloc.files import refuse_to_overwrite
    from topoloc.live.run_log import RunLog
    from topoloc.topo_map import TopoMap

    _refuse_contradictions(camera, video, recording, odometry, fast, camera_toml)
    if log is not None:
        refuse_to_overwrite(log, overwrite)
    the_map = TopoMap.load(topo_map)
    words = settings if rate is None else (*settings, f"live.most_hz={rate}")
    choice = LiveChoice(sensor, estimator, seed, words, state)
    tell = _Teller(the_map, None if log is None else RunLog(log, overwrite, the_map), json)
    with closing(_source(the_map, camera, video, recording, odometry, offset_s, camera_toml)) as source:
        live = live_localizer(the_map, choice, source.rig, source.kinds)
        try:
            with stopped_by_signals():
                _work(live, source, odometry == "-", fast, tell)
        finally:
            tell.end(live, state)


def _refuse_contradictions(
    camera: str | None,
    video: Path | None,
    recording: Path | None,
    odometry: str | None,
    fast: bool,
    camera_toml: Path | None,
) -> None:
    """One source of pictures, and nothing that it cannot use."""
    from topoloc.errors import UserError

    if sum(source is not None for source in (camera, video, recording)) != 1:
        raise UserError("where do the pictures come from? give one of --camera 0, --video FILE, --recording FOLDER")
    if fast and (camera is not None or odometry == "-"):
        raise UserError("--fast plays what is on the disk; a camera and standard input have their own pace")
    if recording is not None and camera_toml is not None:
        raise UserError("--camera-toml: a recording has its own camera.toml; correct that one")
    if recording is not None and odometry not in (None, "none"):
        raise UserError("--odometry: a recording has its own odometry.txt; leave the option out, or write none")
    if camera is not None and odometry not in (None, "none", "-"):
        raise UserError("--odometry FILE is for a video; pipe in what a robot's driver says, and write --odometry -")


def _source(
    the_map: TopoMap,
    camera: str | None,
    video: Path | None,
    recording: Path | None,
    odometry: str | None,
    offset_s: float,
    camera_toml: Path | None,
) -> Source:
    """Where the pictures come from."""
    from topoloc.live import sources

    if recording is not None:
        return sources.of_recording(recording, the_map, with_odometry=odometry != "none")
    rig = sources.rig_on(camera_toml, the_map)
    if video is not None:
        return sources.of_video(video, rig, None if odometry in (None, "none", "-") else Path(odometry), offset_s)
    assert camera is not None  # one of the three is given
    return sources.of_camera(camera, rig)


def _work(live: LiveLocalizer, source: Source, piped: bool, fast: bool, tell: Callable[[LiveReport], None]) -> None:
    """Until the pictures end, or Ctrl-C."""
    import sys
    from threading import Event

    from topoloc.live.feeds import run_fed
    from topoloc.live.messages import replay
    from topoloc.live.odometry_lines import LineFeed

    if source.note:
        print(f"warning: {source.note}", file=sys.stderr)
    if fast and source.messages is not None:
        replay(source.messages, live, tell)
        return
    print("ready for pictures; Ctrl-C ends", file=sys.stderr)
    others: list[Feed] = [LineFeed(sys.stdin)] if piped else []
    run_fed(live, source.feed, others, tell, Event())


class _Teller:
    """Prints reports: JSON lines, one line that is rewritten on a terminal, or lines at changes; and logs them."""

    def __init__(self, the_map: TopoMap, log: RunLog | None, as_json: bool) -> None:
        import sys

        self._map, self._log, self._json = the_map, log, as_json
        self._rewrites = not as_json and sys.stdout.isatty()
        self._told: tuple[str, str | None, float] = ("", None, 0.0)  # status, place and time of the last line

    def __call__(self, report: LiveReport) -> None:
        """Print and log a report."""
        import shutil

        from topoloc.live.lines import as_json, as_line

        if self._log is not None:
            self._log.add(report)
        if self._json:
            print(as_json(report, self._map), flush=True)
            return
        line = as_line(report, self._map)
        if self._rewrites:
            print(f"\r\x1b[K{line[: shutil.get_terminal_size().columns - 1]}", end="", flush=True)
            return
        status, node_id, time = self._told
        if (report.status.value, report.node_id) != (status, node_id) or abs(report.timestamp - time) >= TELL_EVERY_S:
            self._told = report.status.value, report.node_id, report.timestamp
            print(line, flush=True)

    def end(self, live: LiveLocalizer, state: Path | None) -> None:
        """Finish the log, and say what came of it all and what is next; nothing where no picture was used."""
        import sys

        from topoloc.live.lines import summary

        if self._log is not None and live.counts.used:
            self._log.close()  # before anything is printed, which a closed pipe would end
        if self._rewrites:
            print()
        if not live.counts.used:
            return
        out = sys.stderr if self._json else sys.stdout
        print(summary(live.counts), file=out)
        if self._log is not None:
            print(f"{self._log.folder}: trajectory.txt, steps.csv", file=out)
        if state is not None and state.exists():
            print(f"{state}: the belief; the same command goes on from there", file=out)
