"""``topoloc import cold``: sequences of the COLD database, one or a published split."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from topoloc.cli.import_options import Overwrite
from topoloc.cli.public_sets import ListSplits, MaybeFolder, MaybeOutput, SpacingM, SplitName


def import_cold(
    sequence: MaybeFolder = None,
    *,
    output: MaybeOutput = None,
    camera: Annotated[
        Literal["std", "omni"], Parameter(help="The perspective camera, or the one below a mirror.")
    ] = "std",
    split: SplitName = None,
    list_splits: ListSplits = False,
    every: Annotated[float, Parameter(help="Seconds from picture to picture; 0 takes all.")] = 0.0,
    spacing_m: SpacingM = 1.0,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a sequence of COLD, or scenarios of a published split.

    A sequence is a folder such as seq1_cloudy1 with std_cam, omni_cam, localization and odom_scans in it. Truth is
    taken from the pictures' names, rooms from localization/places.lst into rooms.csv.

    Example: ``topoloc import cold COLD --split freiburg-light -o scenarios``
    """
    from topoloc.cli.public_sets import PublicSet, asked, build_config, import_one, import_split, list_of_splits
    from topoloc.errors import UserError
    from topoloc.importing.public.cold import read_cold
    from topoloc.importing.public.cold_splits import SPLITS, find_cold
    from topoloc.importing.thinning import Thinning

    if list_splits:
        return list_of_splits(SPLITS)
    folder, made = asked(sequence, output, "cold")
    public = PublicSet("cold", SPLITS, find_cold, lambda path: read_cold(path, camera))
    if split is None:
        return import_one(public, folder, made, Thinning(every), overwrite)
    if camera == "omni":
        raise UserError("--split builds maps, which --camera omni cannot: its mirror is not documented; take std")
    return import_split(public, split, folder, made, Thinning(every), build_config(spacing_m), overwrite)
