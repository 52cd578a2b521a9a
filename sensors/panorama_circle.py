"""Panorama reconstruction that closes the circle: pairs of neighbours matched, the error spread over the whole turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d

from sensors.panorama import (
    GapTooWide,
    Insertion,
    Panorama,
    PanoramaConfig,
    feathered,
    filled_columns,
    filtered,
    gaps_between,
    named,
    on_cylinder,
    refuse_unusable,
)
from sensors.panorama_pairs import LEAST_OVERLAP_DEG, RESOLUTION_DEG, gradients, step_evidence
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera
from topoloc.types import Image, Ints

MOST_SNAPSHOTS = 180
"""More of them lie closer together than steps can be told apart."""
STRAY = 0.01
"""How likely any step is, beside the nominal one: a robot that got stuck, or that ended its turn short (5.1.2)."""
SHOWS_NOTHING = float(np.log(2.0))
"""Evidence below this is no more than chance."""
WIDEST_GAP = 0.5
"""A gap may be this share of a view."""
SCALES = tuple(round(0.9 + 0.01 * k, 2) for k in range(21))
"""Factors of the field of view that are tried where something is wrong."""
SCALE_GAIN = 10.0
"""By how much more one of them must be worth to be named."""
COARSE = 3
"""Candidate steps taken together meanwhile: nine times as fast."""


@dataclass(frozen=True)
class CircleConfig(PanoramaConfig):
    """Settings of the method that closes the circle, beside those that every method has.

    Attributes:
        step_deg: nominal turn between two snapshots, degrees clockwise; none: 360 divided by their number.
        step_sd_deg: standard deviation of the true turns around it, degrees.
    """

    step_deg: float | None = None
    step_sd_deg: float = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hfov_deg < LEAST_OVERLAP_DEG:
            raise ValueError(
                f"hfov_deg is {self.hfov_deg}; this method needs views at least {LEAST_OVERLAP_DEG:g} wide"
            )
        if self.step_deg is not None and not 0.0 < self.step_deg < 180.0:
            raise ValueError(f"step_deg is {self.step_deg}; it must lie between 0 and 180, or be left out")
        if not 0.0 < self.step_sd_deg < np.inf:
            raise ValueError(f"step_sd_deg is {self.step_sd_deg}; it must be positive")


class CircleReconstruction:
    """Neighbours matched in pairs, and the closed circle of steps that explains all of them best.

    Each pair says how likely every step between its two snapshots is; the nominal step, which the odometer gave
    (5.1.2), says so without looking; the steps that maximise the sum of both and add up to 360 degrees are taken.
    Where a pair shows nothing the others decide.
    """

    Config = CircleConfig

    def __init__(self, config: CircleConfig | None = None) -> None:
        self.config = config or CircleConfig()

    def reconstruct(
        self,
        snapshots: Sequence[Image],
        progress: Callable[[int], None] | None = None,
        names: Sequence[str] | None = None,
    ) -> Panorama:
        """Find the heading of each snapshot, and paste them into a circle, neighbours fading into each other.

        Frames are bent onto the cylinder first, so that the columns are linear in angle within each of them too: an
        option of EQUATIONS.md, 1, that IMA's headings are better for (docs/panoramas.md).

        Args:
            snapshots: RGB or grey, of one size, in the order they were taken: one turn, clockwise.
            progress: called with the number of snapshots matched with the next.
            names: of the snapshots, for messages; None counts them from 1.

        Raises:
            UserError: no snapshots, too many, or of different sizes.
            GapTooWide: two neighbours leave more than half a view between them unseen.
        """
        refuse_unusable(snapshots)
        if len(snapshots) > MOST_SNAPSHOTS:
            raise UserError(f"{len(snapshots)} snapshots are too many for one turn; take {MOST_SNAPSHOTS} at most")
        evidence = self._match_neighbours(snapshots, progress)
        prior = step_prior(self.config.step_deg or 360.0 / len(snapshots), self.config.step_sd_deg)
        steps = best_closed_steps(worth_of(evidence, prior))
        made = self._paste(snapshots, evidence, prior, steps, named(snapshots, names))
        hint = self._hint_at_field_of_view(evidence, prior) if made.notes else ""
        for first, second, gap in made.gaps:
            if gap > WIDEST_GAP * self.config.hfov_deg:
                raise GapTooWide((first, second), named(snapshots, names), made, f"; {hint}" if hint else "")
        return replace(made, notes=(*made.notes, hint)) if hint else made

    def explain(self, snapshots: Sequence[Image], made: Panorama, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """Pictures of every insertion and of the whole circle (4.1.2): see ``sensors.panorama_pictures``."""
        from sensors.panorama_pictures import circle_picture, insertion_pictures

        pictures = self._bent(snapshots)
        yield from insertion_pictures(pictures, made, names, feathered)
        yield circle_picture(made, names, self.config.hfov_deg)

    def _match_neighbours(self, snapshots: Sequence[Image], progress: Callable[[int], None] | None) -> Floats:
        """Evidence (S, columns) on the step from each snapshot to the next, from the last to the first as well."""
        ready = [gradients(snapshot, self.config.hfov_deg) for snapshot in snapshots]
        evidence = []
        for done, (first, second) in enumerate(zip(ready, ready[1:] + ready[:1], strict=True), start=1):
            evidence.append(step_evidence(first, second))
            if progress is not None:
                progress(done)
        return np.stack(evidence)

    def _hint_at_field_of_view(self, evidence: Floats, prior: Floats) -> str:
        scale = closing_scale(evidence, prior)
        return "" if scale == 1.0 else f"with hfov_deg {scale * self.config.hfov_deg:.1f} the circle would close better"

    def _bent(self, snapshots: Sequence[Image]) -> list[Image]:
        """The snapshots as they are pasted: filtered, on the cylinder, of the same size."""
        shape = snapshots[0].shape[:2]
        per_rad = shape[1] / np.deg2rad(self.config.hfov_deg)
        return [on_cylinder(filtered(one, self.config), self.config.hfov_deg, shape, per_rad) for one in snapshots]

    def _paste(
        self, snapshots: Sequence[Image], evidence: Floats, prior: Floats, steps: Ints, names: Sequence[str]
    ) -> Panorama:
        """The panorama of these steps (S,), with what is to be told of it."""
        pictures = self._bent(snapshots)
        rows, width = pictures[0].shape[:2]
        camera = Camera(self.config.hfov_deg, width, rows)
        columns = camera.panorama_columns()
        turned = np.deg2rad(RESOLUTION_DEG) * np.concatenate([[0], np.cumsum(steps)[:-1]])
        lefts = np.rint(turned / (2.0 * np.pi) * columns).astype(np.int64) % columns
        headings = wrap(np.deg2rad(self.config.start_deg) - turned)
        gaps = gaps_between(headings, self.config.hfov_deg)
        return Panorama(
            feathered(pictures, lefts, columns),
            lefts,
            headings,
            float(wrap(headings[0] + np.pi * width / columns)),
            float(filled_columns(lefts, width, columns).mean()),
            gaps,
            (*_notes_on_gaps(gaps, names), *_notes_on_chance(evidence, steps, names)),
            _reasons(evidence, prior, steps),
        )


def step_prior(nominal_deg: float, sd_deg: float) -> Floats:
    """Log-likelihood (C,) of steps of 0, 1, ... times ``RESOLUTION_DEG`` up to a full turn, before looking.

    Normal around the nominal step, and no less than ``STRAY`` of its peak anywhere.
    """
    step = np.arange(round(360.0 / RESOLUTION_DEG) + 1) * RESOLUTION_DEG
    return np.asarray(np.log(np.exp(-0.5 * ((step - nominal_deg) / sd_deg) ** 2) + STRAY))


def worth_of(evidence: Floats, prior: Floats) -> Floats:
    """Evidence (S, n) on the smaller steps and prior (C,) on all of them, in one table (S, C)."""
    worth = np.tile(prior, (len(evidence), 1))
    shared = min(evidence.shape[1], len(prior))
    worth[:, :shared] += evidence[:, :shared]
    return worth


def best_closed_steps(worth: Floats) -> Ints:
    """The steps that add up to a full turn and are worth most together, by dynamic programming. [ours].

    Args:
        worth: (S, C) of each of S steps, if it is 0, 1, ... C - 1 units large, the last being a full turn.

    Returns:
        (S,) in units; their sum is C - 1.
    """
    full = worth.shape[1] - 1
    best, choices = worth[0], []
    for of_this in worth[1:]:
        # best[t] = max over s of best[t - s] + of_this[s]; what lies before the start is impossible.
        padded = np.concatenate([np.full(full, -np.inf), best])
        sums = sliding_window_view(padded, full + 1)[:, ::-1] + of_this
        choices.append(sums.argmax(axis=1))
        best = sums.max(axis=1)
    steps, turned = [], full
    for choice in reversed(choices):
        steps.append(int(choice[turned]))
        turned -= steps[-1]
    return np.array([turned, *reversed(steps)])


def closing_scale(evidence: Floats, prior: Floats) -> float:
    """The factor by which all steps that the pictures say must grow so that the circle closes best.

    A field of view that is too small by some factor makes every step too small by nearly the same one. [ours]

    Returns:
        1 unless another one makes the whole worth more by ``SCALE_GAIN``, which a turn that ends short never does.
    """
    units = np.arange(evidence.shape[1])
    worths = []
    for scale in SCALES:
        longer = np.arange(int(evidence.shape[1] * scale)) / scale
        worth = worth_of(np.stack([np.interp(longer, units, one) for one in evidence]), prior)
        coarse = maximum_filter1d(worth, COARSE, axis=1)[:, ::COARSE]
        worths.append(float(coarse[np.arange(len(coarse)), best_closed_steps(coarse)].sum()))
    best = int(np.argmax(worths))
    return SCALES[best] if worths[best] > worths[SCALES.index(1.0)] + SCALE_GAIN else 1.0


def _reasons(evidence: Floats, prior: Floats, steps: Ints) -> tuple[Insertion, ...]:
    """Why each snapshot stands where it does: its step from the one before, for the first one from the last."""
    candidates = np.asarray(np.arange(evidence.shape[1]) * RESOLUTION_DEG, dtype=np.float64)
    reasons = [
        Insertion(pair, candidates, seen, prior[: len(seen)], float(step * RESOLUTION_DEG))
        for pair, (seen, step) in enumerate(zip(evidence, steps, strict=True))
    ]
    return (reasons[-1], *reasons[:-1])


def _notes_on_gaps(gaps: Sequence[tuple[int, int, float]], names: Sequence[str]) -> Iterator[str]:
    for first, second, gap in gaps:
        yield f"{names[first]} and {names[second]} do not overlap: {gap:.1f} degrees between them stay black"


def _notes_on_chance(evidence: Floats, steps: Ints, names: Sequence[str]) -> Iterator[str]:
    """A sentence for each pair that overlaps and yet shows nothing that tells its step."""
    overlapping = steps < evidence.shape[1]
    shown = evidence[np.arange(len(steps)), np.minimum(steps, evidence.shape[1] - 1)]
    unsure = np.flatnonzero(overlapping & (shown < SHOWS_NOTHING)).tolist()
    for first in unsure:
        step_deg = steps[first] * RESOLUTION_DEG
        yield (
            f"{names[first]} and {names[(first + 1) % len(names)]} show nothing in common that tells their step: "
            f"{step_deg:.1f} degrees follow from the nominal step and the closed circle"
        )
    if 2 * len(unsure) > len(steps):
        yield "most neighbours do not match: snapshots must be in order, turning clockwise, and hfov_deg theirs"
