"""A split on a disk: a folder a pair, each with ``map/`` and ``recording/``, as a benchmark takes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from topoloc.errors import UserError
from topoloc.files import write_text
from topoloc.importing.public.room_rate import write_node_rooms
from topoloc.importing.public.sequence import Drive, write_drives
from topoloc.importing.public.splits import Pair, Split
from topoloc.importing.recording_sink import Imported, RecordingSink
from topoloc.importing.thinning import Thinning
from topoloc.mapping.building import BuildConfig, Built, build_map
from topoloc.recording import Recording

TRAIN, MAP, RECORDING, PAIR_FILE = "train", "map", "recording", "pair.toml"


@dataclass
class SplitImport:
    """Imports drives and builds maps into a folder.

    Attributes:
        folder: to write into.
        read: the drive of a sequence, by its name.
        thinning: which pictures are taken.
        build: how maps are built.
        progress: told what is being done.
        told: of each recording that was written, by its path below the folder.
        notes: of each drive.
    """

    folder: Path
    read: Callable[[str], Drive]
    thinning: Thinning
    build: BuildConfig
    progress: Callable[[str], object] = lambda _: None
    told: dict[str, Imported] = field(default_factory=dict)
    notes: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def write(self, set_name: str, split: Split) -> dict[str, Built]:
        """Write a split; returns the maps by the name of their pair.

        Raises:
            UserError: a sequence cannot be read, or no map can be built of one.
        """
        built: dict[tuple[str, ...], Built] = {}
        for pair in split.pairs:
            if pair.train not in built:
                built[pair.train] = self._map_of(pair.train)
            self._record((pair.query,), f"{pair.name}/{RECORDING}")
            place = self.folder / pair.name
            built[pair.train].topo_map.save(place / MAP)
            write_node_rooms(place, built[pair.train].topo_map, self.folder / _train(pair.train))
            write_text(place / PAIR_FILE, _pair_toml(set_name, split, pair))
        return {pair.name: built[pair.train] for pair in split.pairs}

    def _map_of(self, train: tuple[str, ...]) -> Built:
        self._record(train, _train(train))
        self.progress(f"building the map of {' and '.join(train)}")
        return build_map(Recording.load(self.folder / _train(train)), self.build, "+".join(train), _quiet)

    def _record(self, names: Sequence[str], place: str) -> None:
        """Write the recording of one or several sequences."""
        drives = []
        for name in names:
            self.progress(f"importing {name}")
            drives.append(self.read(name))
            self.notes[name] = drives[-1].notes
        rig = drives[0].rig
        if rig.camera is None:
            raise UserError(f"{names[0]}: its field of view is not documented, and a map needs it; give --hfov-deg")
        sink = RecordingSink(self.folder / place)
        write_drives(drives, sink, self.folder / place, self.thinning)
        self.told[place] = sink.close(rig)


def _quiet(what: str, done: int, total: int) -> None:
    """Map building tells of each picture; a split tells of each sequence."""


def _train(names: Sequence[str]) -> str:
    return f"{TRAIN}/{'+'.join(names).replace('/', '-')}"


def _pair_toml(set_name: str, split: Split, pair: Pair) -> str:
    """What a pair is, for people and for ``topoloc score``."""
    import tomli_w

    table: Mapping[str, object] = {
        "set": set_name,
        "split": split.name,
        "train": list(pair.train),
        "query": pair.query,
        "source": split.source,
        "verified": split.verified,
        "figure": split.figure,
    }
    return tomli_w.dumps(table)
