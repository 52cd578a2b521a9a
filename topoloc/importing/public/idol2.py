"""KTH-IDOL2: an office of five rooms, driven by two robots under clouds, sun and at night, over half a year.

J. Luo, A. Pronobis, B. Caputo, P. Jensfelt: The KTH-IDOL2 database, technical report, KTH, 2006. Sequences are called
``min_cloudy1`` (Minnie, a PeopleBot) to ``dum_sunny4`` (Dumbo, a PowerBot), their pictures lie in ``png/``; seen in
two published scripts, docs/public_sets.md.

unverified: the names of the pictures. They tell time, room, x, y and angle in this order (seen), and are read as
``t<seconds>_r<room>_x<metres>_y<metres>_a<radians>``, the words in any order; angles beyond a circle in radians are
taken for degrees. No field of view is known here, and no odometry is read.
"""

from __future__ import annotations

from pathlib import Path

from topoloc.importing.public.heading_check import heading_note
from topoloc.importing.public.levels import refuse_level
from topoloc.importing.public.pose_names import named_shots
from topoloc.importing.public.sequence import Drive

PICTURES = "png"
LOOKS = "png/ with pictures such as t<seconds>_r<room>_x<metres>_y<metres>_a<radians>.png"
STEP_M = 0.02


def read_idol2(folder: Path) -> Drive:
    """A sequence; its pictures lie in ``png/``, or in the folder itself.

    Raises:
        InputError: no sequence, or names that tell no pose.
    """
    pictures = folder / PICTURES
    if not pictures.is_dir():
        if not folder.is_dir() or not any(folder.glob("t*_x*")) or folder.name == PICTURES:
            refuse_level(folder, (PICTURES,), LOOKS)
        pictures = folder
    shots, dropped, degrees = named_shots(pictures)
    notes = ["no odometry is documented: there is none"]
    if degrees:
        notes.append("the angles of the names were read as degrees: they are beyond a circle in radians")
    if all(shot.room is None for shot in shots):
        notes.append("the names tell no rooms")
    notes += filter(None, [heading_note(shots, STEP_M)])
    return Drive(folder.resolve().name, "rgb", shots, notes=tuple(notes), dropped=dropped)
