"""``topoloc import oxford``: traversals of the RobotCar, one or a published split, and pictures named by UTM."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.import_options import HfovDeg, Overwrite
from topoloc.cli.public_sets import ListSplits, MaybeFolder, MaybeOutput, SpacingM, SplitName


def import_oxford(
    traversal: MaybeFolder = None,
    *,
    output: MaybeOutput = None,
    camera: Annotated[
        Literal["centre", "left", "right"], Parameter(help="Of the stereo head of the RobotCar.")
    ] = "centre",
    origin: Annotated[
        str | None,
        Parameter(help="Where x and y begin: an origin.toml, a recording with one, or EASTING,NORTHING."),
    ] = None,
    models: Annotated[
        Path | None, Parameter(help="Folder models of robotcar-dataset-sdk; straightens the pictures.")
    ] = None,
    width: Annotated[int, Parameter(help="Columns to make the pictures narrower to.", validator=Number(gte=16))] = 640,
    hfov_deg: HfovDeg = None,
    split: SplitName = None,
    list_splits: ListSplits = False,
    every: Annotated[float, Parameter(help="Seconds from picture to picture; 0 takes all.")] = 0.5,
    spacing_m: SpacingM = 10.0,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a traversal of the Oxford RobotCar, or scenarios of a published split.

    A traversal is a folder such as 2014-06-26-08-53-56 with stereo, gps and vo in it; a folder of pictures that are
    named @easting@northing@...@.jpg is taken, too. Positions count from the first one,
    which origin.toml keeps: give it as --origin to the other traversals of one town.

    Example: ``topoloc import oxford 2014-06-26-08-53-56 -o june --models robotcar-dataset-sdk/models``
    """
    from topoloc.cli.public_sets import PublicSet, asked, build_config, import_one, import_split, list_of_splits
    from topoloc.importing.public.origin import read_origin
    from topoloc.importing.public.oxford import OneFrame
    from topoloc.importing.public.robotcar import RobotCarConfig
    from topoloc.importing.public.robotcar_splits import SPLITS, find_robotcar
    from topoloc.importing.thinning import Thinning

    if list_splits:
        return list_of_splits(SPLITS)
    folder, made = asked(traversal, output, "oxford")
    frame = OneFrame(RobotCarConfig(camera, width, models), None if origin is None else read_origin(origin), hfov_deg)
    public = PublicSet("oxford", SPLITS, find_robotcar, frame.read, frame.write)
    if split is None:
        return import_one(public, folder, made, Thinning(every), overwrite)
    return import_split(public, split, folder, made, Thinning(every), build_config(spacing_m), overwrite)
