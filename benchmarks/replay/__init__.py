"""What the report's replay shows: pictures of a drive, what each sensor made of them, what each estimator believed.

One drive of each scenario is kept, that of the first seed (``benchmarks.run_files`` says where): a ``Drive``, a list of
``Look`` for each sensor, and a list of ``Answer``, one a frame, for each pair.
"""

from benchmarks.replay.record import account_of, answer_of, cells_of, drive_of, ima_in, look_of, panorama_url, slots_of
from benchmarks.replay.values import (
    Account,
    Answer,
    Cell,
    Drive,
    Hypothesis,
    Line,
    Look,
    NodeSeen,
    Pose,
    Slots,
    as_json,
)

__all__ = [
    "Account",
    "Answer",
    "Cell",
    "Drive",
    "Hypothesis",
    "Line",
    "Look",
    "NodeSeen",
    "Pose",
    "Slots",
    "account_of",
    "answer_of",
    "as_json",
    "cells_of",
    "drive_of",
    "ima_in",
    "look_of",
    "panorama_url",
    "slots_of",
]
