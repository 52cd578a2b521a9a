"""Where sequences lie below a folder, and what to say to someone who named the folder above or below the right one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from topoloc.errors import InputError

DEPTH = 5
"""So many folders down sequences are looked for."""
ABOVE = 2
"""So many folders up a sequence is recognised."""
NAMED = 6
"""So many of them an error names."""


def folders_holding(root: Path, inside: Sequence[str], depth: int = DEPTH) -> list[Path]:
    """Folders at or below ``root``, sorted, that hold one of the folders or files of these names, such as ``std_cam``.

    What lies inside of such a folder is not looked at: the pictures are many.
    """
    if not root.is_dir():
        return []
    if any((root / name).exists() for name in inside):
        return [root]
    if depth == 0:
        return []
    below = sorted(path for path in root.iterdir() if path.is_dir())
    return [found for path in below for found in folders_holding(path, inside, depth - 1)]


def refuse_level(folder: Path, inside: Sequence[str], looks: str) -> NoReturn:
    """Raise ``InputError`` for a folder that is no sequence; says where one is.

    Args:
        folder: that the user named.
        inside: what a sequence holds one of.
        looks: what a sequence looks like.
    """
    wanted = " or ".join(inside)
    if not folder.is_dir():
        raise InputError(folder, "no such folder", f"name the folder of a sequence: {looks}")
    above = next((up for up in folder.resolve().parents[:ABOVE] if any((up / name).exists() for name in inside)), None)
    if above is not None:
        raise InputError(folder, "lies inside of a sequence, too low", f"name {above}")
    below = [str(path.relative_to(folder)) for path in folders_holding(folder, inside)]
    if below:
        more = f" and {len(below) - NAMED} more" if len(below) > NAMED else ""
        remedy = f"name one of the sequences in it: {', '.join(below[:NAMED])}{more}; or give --split"
        raise InputError(folder, f"holds no {wanted}, it is too high", remedy)
    raise InputError(folder, f"holds no {wanted}", f"name the folder of a sequence: {looks}")
