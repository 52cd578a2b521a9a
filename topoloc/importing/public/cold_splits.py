"""Splits of COLD, and where its sequences lie on a disk: ``<laboratory>/seq<number>_<light><number>``.

Numbers of sequences are of one part of a laboratory each (1 and 2: part A, 3 and 4: part B), so that the part need not
be told.
"""

from __future__ import annotations

import re
from pathlib import Path

from topoloc.importing.public.cold import INSIDE
from topoloc.importing.public.levels import folders_holding
from topoloc.importing.public.splits import Split, pairs_of

LABORATORIES = {
    "freiburg": ("freiburg", "friburgo", "fr"),
    "saarbruecken": ("saarbruecken", "saarbrucken", "saarbrücken", "sa"),
    "ljubljana": ("ljubljana", "lj"),
}
"""How a laboratory may be called, in a word of its own, in the path to a sequence."""
SEQUENCE = re.compile(r"seq_?([1-4])_(cloudy|night|sunny)(\d)")

FREIBURG = Split(
    "freiburg-light",
    pairs_of(("freiburg/seq2_cloudy3",), [f"freiburg/seq2_{one}" for one in ("cloudy2", "night2", "sunny2")]),
    "Alfaro, Cabrera, Flores, Reinoso, Paya: README of TripletNetworks: Freiburg, part A, path 2; they train on a half "
    "of seq2_cloudy3, sampled, and take unwrapped omnidirectional pictures",
    True,
    "room retrieval and error of position; no figure could be looked up",
)
LANTERN = Split(
    "lantern",
    (
        *pairs_of(("freiburg/seq2_night1",), ["freiburg/seq2_cloudy1", "freiburg/seq2_sunny1"]),
        *pairs_of(("freiburg/seq3_sunny1",), ["freiburg/seq3_cloudy3"]),
        *pairs_of(("saarbruecken/seq2_night2",), ["saarbruecken/seq1_cloudy2"]),
        *pairs_of(("saarbruecken/seq4_sunny1",), ["saarbruecken/seq3_cloudy1"]),
    ),
    "Rodriguez Villegas: Visual Topological SLAM using Deep Learning Techniques, 2026, README of LANTERN: mapping "
    "sequence and cross-illumination queries",
    True,
    "recall@1 within 5 m of single pictures: 95.0 %, mean of the four environments",
)
SPLITS = {split.name: split for split in (FREIBURG, LANTERN)}


def find_cold(root: Path) -> dict[str, list[Path]]:
    """The sequences below a folder, by name, such as ``freiburg/seq2_cloudy3``.

    The laboratory is told by any folder on the path: ``cold-freiburg/part_a/seq2_cloudy3``, ``fr_seq2_cloudy3`` and
    ``cold-freiburg_part_a_seq2_cloudy3`` are all understood.
    """
    found: dict[str, list[Path]] = {}
    for folder in folders_holding(root, INSIDE):
        words = re.split(r"[^a-zü0-9]+", str(folder.resolve()).lower())
        laboratory = next((lab for lab, names in LABORATORIES.items() if set(names) & set(words)), None)
        sequence = SEQUENCE.search(folder.name.lower())
        if laboratory and sequence:
            name = f"{laboratory}/seq{sequence[1]}_{sequence[2]}{sequence[3]}"
            found.setdefault(name, []).append(folder)
    return found
