"""``topoloc import tum``: a sequence of the TUM RGB-D benchmark with the calibration of its camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from topoloc.cli.import_options import Output, Overwrite


def import_tum(
    sequence: Annotated[Path, Parameter(help="Folder of the sequence, with rgb.txt in it.")],
    *,
    output: Output,
    kinect: Annotated[
        Literal["freiburg1", "freiburg2", "freiburg3"] | None,
        Parameter(name="--set", help="Which Kinect took it, where the folder's name does not tell."),
    ] = None,
    every: Annotated[float, Parameter(help="Seconds from picture to picture; 0 takes all.")] = 0.2,
    start: Annotated[float, Parameter(help="First second that is taken, from the first picture.")] = 0.0,
    end: Annotated[float | None, Parameter(help="Last second that is taken.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a TUM RGB-D sequence, with the published calibration of its Kinect.

    The sequences run as they are, too: this adds the lens and the field of view, thins the pictures, and leaves out
    those that the motion capture does not reach. The pose is the camera's: position, and heading of the optical axis.

    Example: ``topoloc import tum rgbd_dataset_freiburg2_pioneer_slam -o pioneer --every 0.5``
    """
    from math import inf

    from topoloc.cli.imported import tell
    from topoloc.cli.progress import bar
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.recording_sink import OWNED, RecordingSink
    from topoloc.importing.thinning import Thinning
    from topoloc.importing.tum import import_sequence, kinect_of, pairs_with, read_sequence, rig_of

    refuse_to_overwrite(output, overwrite)
    thinning = Thinning(every, start, inf if end is None else end)
    name = kinect_of(sequence, kinect)
    read = read_sequence(sequence)
    with new_folder(output, overwrite, owned=OWNED) as folder, bar() as progress:
        task = progress.add_task("copying pictures", total=len(read))
        sink = RecordingSink(folder)
        import_sequence(read, sink, thinning, lambda: progress.advance(task))
        rig = rig_of(name)
        imported = sink.close(rig)
    field = rig.camera.hfov_deg if rig.camera else 0.0
    print(f"{sequence}: {len(read)} colour pictures of {name}, {field:.1f} degrees; one every {every:g} s is taken")
    if read.truth is None:
        print("no groundtruth.txt: as the _validation sequences are published; there will be no figures")
    for pair in pairs_with(sequence):
        print(f"published pair: map of {pair.map}, localized {pair.query} ({pair.source})")
    tell(output, imported)
