"""``topoloc import images``: a recording of a folder of pictures, and of odometry in a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

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


def import_images(
    folder: Annotated[Path, Parameter(help="Folder of pictures.")],
    *,
    output: Output,
    times: Annotated[Path | None, Parameter(help="CSV of when each was taken, columns file,time_s.")] = None,
    fps: Annotated[float | None, Parameter(help="Pictures a second, in the order of the files.")] = None,
    pattern: Annotated[str, Parameter(help="Of the names that are taken, such as '*_left.png'.")] = "*",
    odometry: OdometryCsv = None,
    truth: TruthCsv = None,
    offset_s: Annotated[
        float, Parameter(help="Added to the pictures' times to have the clock of the CSV files, seconds.")
    ] = 0.0,
    hfov_deg: HfovDeg = None,
    mount_yaw_deg: MountYawDeg = 0.0,
    wheel_base_m: WheelBase = None,
    ticks_per_metre: Ticks = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a folder of pictures, and of odometry and truth in CSV files.

    When each was taken is told by --times or --fps; else by the time in its name, such as 1305031102.175304.png or
    nanoseconds; else by its EXIF. The pictures are copied to the byte; what does not decode, or is of another size
    than most, is left out and counted.

    Example: ``topoloc import images camera/ -o drive --pattern '*_left.png' --odometry odom.csv --hfov-deg 62``
    """
    from topoloc.cli.import_options import read_alongside, rig_of, tell_missing_view
    from topoloc.cli.imported import tell
    from topoloc.cli.progress import bar, track
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.images import find_pictures, import_pictures, look_at
    from topoloc.importing.picture_times import Dated, date
    from topoloc.importing.recording_sink import OWNED, RecordingSink

    refuse_to_overwrite(output, overwrite)
    paths = find_pictures(folder, pattern)
    alongside = read_alongside(odometry, truth, wheel_base_m, ticks_per_metre)
    with new_folder(output, overwrite, owned=OWNED) as made:
        sink = RecordingSink(made)
        shots = look_at(track(paths, "looking at pictures"), sink)
        dated = date(shots, fps, times, sink) if shots else Dated((), (), "unknown")
        with bar() as progress:
            task = progress.add_task("copying pictures", total=len(dated.shots))
            import_pictures(dated, sink, alongside, offset_s, lambda: progress.advance(task))
        size = shots[0].size if shots else (0, 0)
        imported = sink.close(rig_of(hfov_deg, mount_yaw_deg, *size))
    print(f"{folder}: {len(paths)} pictures, {size[0]}x{size[1]}; times {dated.how}")
    tell_missing_view(output, hfov_deg)
    tell(output, imported)
