"""Why a localizer answered what it did at one frame of a benchmark run: in words, in numbers, as a picture."""

from benchmarks.explanation.explanation import Explanation, explain
from benchmarks.explanation.picture import draw_explanation
from benchmarks.explanation.rerun import Rerun, choose_key, difference, refuse_without_result, run_again
from benchmarks.explanation.tables import print_explanation

__all__ = [
    "Explanation",
    "Rerun",
    "choose_key",
    "difference",
    "draw_explanation",
    "explain",
    "print_explanation",
    "refuse_without_result",
    "run_again",
]
