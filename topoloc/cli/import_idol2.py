"""``topoloc import idol2``: sequences of KTH-IDOL2, one or a split."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from topoloc.cli.import_options import HfovDeg, Overwrite
from topoloc.cli.public_sets import ListSplits, MaybeFolder, MaybeOutput, SpacingM, SplitName


def import_idol2(
    sequence: MaybeFolder = None,
    *,
    output: MaybeOutput = None,
    hfov_deg: HfovDeg = None,
    split: SplitName = None,
    list_splits: ListSplits = False,
    every: Annotated[float, Parameter(help="Seconds from picture to picture; 0 takes all.")] = 0.0,
    spacing_m: SpacingM = 1.0,
    overwrite: Overwrite = False,
) -> None:
    """Make a recording of a sequence of KTH-IDOL2, or scenarios of a split.

    A sequence is a folder such as min_cloudy1 with png in it. Truth and rooms are taken from the pictures' names. The
    set tells no field of view; a split needs --hfov-deg.

    Example: ``topoloc import idol2 min_cloudy1 -o minnie``
    """
    from topoloc.cli.public_sets import PublicSet, asked, build_config, import_one, import_split, list_of_splits
    from topoloc.errors import UserError
    from topoloc.importing.public.idol2 import read_idol2
    from topoloc.importing.public.idol2_splits import SPLITS, find_idol2
    from topoloc.importing.thinning import Thinning

    if list_splits:
        return list_of_splits(SPLITS)
    folder, made = asked(sequence, output, "idol2")
    public = PublicSet("idol2", SPLITS, find_idol2, lambda path: read_idol2(path).with_field_of_view(hfov_deg))
    if split is None:
        return import_one(public, folder, made, Thinning(every), overwrite)
    if hfov_deg is None:
        raise UserError("--split builds maps, which need the field of view, and the set tells none; give --hfov-deg")
    return import_split(public, split, folder, made, Thinning(every), build_config(spacing_m), overwrite)
