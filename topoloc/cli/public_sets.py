"""What the importers of public sets have in common: options, one sequence, a whole split, and the list of splits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.importing.public.sequence import Drive
    from topoloc.importing.public.splits import Split
    from topoloc.importing.thinning import Thinning
    from topoloc.mapping.building import BuildConfig, Built

VIEWS_A_NODE = 0.3
"""Distance between training views, of that between nodes; what 'topoloc map build' has by default."""

SplitName = Annotated[
    str | None,
    Parameter(name="--split", help="Import all sequences of a published split below the folder, and build its maps."),
]
ListSplits = Annotated[bool, Parameter(help="Say which splits there are, and end.", negative="")]
MaybeFolder = Annotated[Path | None, Parameter(help="Folder of a sequence; with --split, of the set.")]
MaybeOutput = Annotated[
    Path | None, Parameter(name=["--output", "-o"], help="Folder to make: a recording, or one a pair of the split.")
]
SpacingM = Annotated[float, Parameter(help="With --split: between nodes of the maps, metres.")]


@dataclass(frozen=True)
class PublicSet:
    """A public set as the commands see it.

    Attributes:
        name: of the set, as of its command.
        splits: by name.
        find: the folders of each sequence below a folder, by name.
        read: the drive of a sequence's folder.
        after: told the finished folder, before it appears, to write what belongs beside.
    """

    name: str
    splits: Mapping[str, Split]
    find: Callable[[Path], Mapping[str, list[Path]]]
    read: Callable[[Path], Drive]
    after: Callable[[Path], object] = lambda _: None


def asked(folder: Path | None, output: Path | None, set_name: str) -> tuple[Path, Path]:
    """The folder to read and the one to make. Raises ``UserError`` where one is not named."""
    from topoloc.errors import UserError

    if folder is None:
        raise UserError(f"name the folder to import, as 'topoloc import {set_name} FOLDER -o DIR'")
    if output is None:
        raise UserError("name the folder to make with -o DIR")
    return folder, output


def build_config(spacing_m: float) -> BuildConfig:
    """How maps of a split are built: views three times as dense as nodes. Raises ``UserError``."""
    from topoloc.errors import UserError
    from topoloc.mapping.building import BuildConfig

    try:
        return BuildConfig(spacing_m=spacing_m, view_spacing_m=VIEWS_A_NODE * spacing_m)
    except ValueError as error:
        raise UserError(str(error)) from None


def import_one(public: PublicSet, folder: Path, output: Path, thinning: Thinning, overwrite: bool) -> None:
    """Make a recording of one sequence, and say what came of it."""
    from topoloc.cli.imported import tell
    from topoloc.cli.progress import bar
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.public.sequence import write_drives
    from topoloc.importing.recording_sink import OWNED, RecordingSink

    refuse_to_overwrite(output, overwrite)
    drive = public.read(folder)
    with new_folder(output, overwrite, owned=OWNED) as made, bar() as progress:
        task = progress.add_task("copying pictures", total=len(drive.shots))
        sink = RecordingSink(made)
        write_drives([drive], sink, made, thinning, lambda: progress.advance(task))
        imported = sink.close(drive.rig)
        public.after(made)
    print(f"{drive.name}: {len(drive.shots)} {drive.kind} pictures")
    _tell_notes(drive.notes)
    if drive.kind == "rgb" and drive.rig.camera is None:
        print("field of view: not documented; give --hfov-deg, or let 'topoloc camera turn' find it")
    tell(output, imported)


def import_split(
    public: PublicSet, name: str, root: Path, output: Path, thinning: Thinning, build: BuildConfig, overwrite: bool
) -> None:
    """Make a folder of each pair of a split, with its map and its recording, and say what came of it."""
    from topoloc.cli.progress import bar
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.public.split_import import SplitImport
    from topoloc.importing.public.splits import choose, find

    refuse_to_overwrite(output, overwrite)
    split = choose(public.splits, name)
    where = find(split, root, public.find(root))
    with new_folder(output, overwrite) as made, bar() as progress:
        task = progress.add_task("", total=None)
        job = SplitImport(
            made,
            lambda sequence: public.read(where[sequence]),
            thinning,
            build,
            lambda what: progress.update(task, description=what),
        )
        maps = job.write(public.name, split)
        public.after(made)
    for sequence, notes in job.notes.items():
        print(f"{sequence}:")
        _tell_notes(notes, "  ")
    for place, imported in job.told.items():
        counts = ", ".join(f"{count} {kind}" for kind, count in imported.frames.items())
        lost = "".join(f"; dropped: {count} x {what}: {why}" for (what, why), count in imported.dropped.items())
        print(f"{output / place}: {counts} pictures, {imported.odometry or 'no'} odometer poses{lost}")
    _tell_split(split, maps, output)


def _tell_split(split: Split, maps: Mapping[str, Built], output: Path) -> None:
    for pair, built in maps.items():
        views = f"{len(built.topo_map.nodes)} nodes, {len(built.topo_map.views)} views"
        print(f"{output / pair}/map: {views} along {built.length_m:.1f} m")
    print(f"source: {split.source}{'' if split.verified else ' (as remembered, not looked up)'}")
    print(f"reported there: {split.figure}")
    names = [pair.name for pair in split.pairs]
    print(f"next: topoloc bench --scenarios {' '.join(str(output / name) for name in names)}")
    first = output / names[0]
    print(f"or: topoloc localize {first}/map {first}/recording --sensor pca --estimator particle -o run")
    print(f"then: topoloc score run {first}")


def _tell_notes(notes: tuple[str, ...], indent: str = "") -> None:
    """Print notes; those that warn on the error stream."""
    import sys

    for note in notes:
        print(f"{indent}{note}", file=sys.stderr if note.startswith("warning") else sys.stdout)


def list_of_splits(splits: Mapping[str, Split]) -> None:
    """Print the splits: their pairs, where they are from, and what is reported."""
    for split in splits.values():
        print(split.name)
        print(f"  source: {split.source}{'' if split.verified else ' (as remembered, not looked up)'}")
        print(f"  reported: {split.figure}")
        for pair in split.pairs:
            print(f"  map of {' and '.join(pair.train)}, localized {pair.query}")
