"""An experiment's figure as a small PNG, all in one style."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from topoloc.files import write_bytes

if TYPE_CHECKING:
    from benchmarks.experiments.experiment import Experiment, Measured

SIZE_IN, DPI = (7.5, 4.2), 100
PUBLISHED, THESIS, OURS, OTHER = "0.45", "#0072B2", "#D55E00", "#009E73"
"""Colours that colour-blind readers tell apart: what was printed, the thesis's method, ours, and a third thing."""


def write_figure(path: Path, experiment: Experiment, measured: Sequence[Measured]) -> None:
    """Draw an experiment and write it, whole."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE_IN, dpi=DPI, layout="constrained")
    experiment.draw(measured, figure)
    figure.suptitle(f"{experiment.title} (simulated)", fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    write_bytes(path, buffer.getvalue())
