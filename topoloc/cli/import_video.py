"""``topoloc import video``: a recording of a video file, and of odometry in a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.import_options import (
    HfovDeg,
    MountYawDeg,
    OdometryCsv,
    Output,
    Overwrite,
    Ticks,
    TruthCsv,
    WheelBase,
)
from topoloc.cli.numbers import Whole

if TYPE_CHECKING:
    from topoloc.importing.video import FramesRead, Video

EVERY_S = 0.2
"""From one frame to the next where nothing else is asked for [s]."""


def import_video(
    file: Annotated[Path, Parameter(help="Video file.")],
    *,
    output: Output,
    odometry: OdometryCsv = None,
    truth: TruthCsv = None,
    every: Annotated[
        float | None, Parameter(help=f"Seconds from frame to frame; 0 takes all. {EVERY_S:g} by default.")
    ] = None,
    fps: Annotated[float | None, Parameter(help="The same as frames a second.")] = None,
    start: Annotated[float, Parameter(help="First second of the video that is taken.")] = 0.0,
    end: Annotated[float | None, Parameter(help="Last second of the video that is taken.")] = None,
    offset_s: Annotated[
        float, Parameter(help="Time of the video's first frame on the clock of the CSV files, seconds.")
    ] = 0.0,
    width: Annotated[Whole | None, Parameter(help="Scale down to so many columns.", validator=Number(gte=1))] = None,
    hfov_deg: HfovDeg = None,
    mount_yaw_deg: MountYawDeg = 0.0,
    wheel_base_m: WheelBase = None,
    ticks_per_metre: Ticks = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a video, and of odometry and truth in CSV files.

    Frames have the video's own times, stand upright as phones tell it, and are saved as JPEG. Frames that odometry or
    truth do not reach are left out and counted.

    Example: ``topoloc import video drive.mp4 -o drive --odometry odom.csv --offset-s 12.5 --hfov-deg 62``
    """
    from math import inf

    from topoloc.cli.import_options import read_alongside, rig_of, tell_missing_view
    from topoloc.cli.imported import tell
    from topoloc.cli.progress import bar
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.recording_sink import OWNED, RecordingSink
    from topoloc.importing.thinning import Thinning
    from topoloc.importing.video import Video, every_of, import_frames

    refuse_to_overwrite(output, overwrite)
    thinning = Thinning(every_of(every, fps, EVERY_S), start, inf if end is None else end)
    with Video(file) as video:
        alongside = read_alongside(odometry, truth, wheel_base_m, ticks_per_metre)
        with new_folder(output, overwrite, owned=OWNED) as folder, bar() as progress:
            task = progress.add_task("reading frames", total=video.announced or None)
            sink = RecordingSink(folder)
            read = import_frames(video, sink, thinning, alongside, offset_s, width, lambda: progress.advance(task))
            imported = sink.close(rig_of(hfov_deg, mount_yaw_deg, read.width, read.height))
    _tell_video(file, video, read, thinning.every_s)
    tell_missing_view(output, hfov_deg)
    tell(output, imported)


def _tell_video(file: Path, video: Video, read: FramesRead, every_s: float) -> None:
    how_often = f"one every {every_s:g} s is taken" if every_s else "all are taken"
    turned = f", turned upright by {video.turned_deg} degrees" if video.turned_deg else ""
    print(f"{file}: {read.frames} frames in {read.seconds:.1f} s, {how_often}, {read.width}x{read.height}{turned}")
    if read.guessed:
        print(f"  {read.guessed} frames have no time of their own: each is 1/{video.fps:g} s after the one before")
