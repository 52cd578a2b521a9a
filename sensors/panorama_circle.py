"""Panorama reconstruction that closes the circle: pairs of neighbours matched, the error spread over the whole turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d

from sensors.images import resize
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
from sensors.panorama_pairs import LEAST_OVERLAP_DEG, RESOLUTION_DEG, gradients, step_doubt, step_evidence
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
"""Apparent fields of view that are tried, as shares of the one given."""
SCALE_SD = 0.05
"""Standard deviation of the apparent field of view before looking, as a share of the one given."""
SCALE_GAIN = 8.0
"""By how much more a wider view must be worth: it closes the circle as well as a gap does, which nobody sees.

A narrower one must not: no gap makes steps add up to more than a turn. In laboratories 100 to 109 turns 15 degrees
short gain 6.5 at most."""
COARSE = 3
"""Candidate steps taken together meanwhile: nine times as fast."""
TOLD_SCALE = 0.015
"""An apparent field of view that differs by more is told to the user."""


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

    A field of view that is not quite the one given makes all steps too large or too small by one factor; a camera
    ahead of the axis that it turns about does nearly the same, since things then cross its view faster. The closed
    circle tells this factor, see ``closing_scale``.
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
        option of EQUATIONS.md, 1, that IMA's headings are better for (docs/panoramas.md). They are as many columns wide
        as they seem to be on a circle of ``Camera.panorama_columns`` of the field of view given, which is the map's.

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
        evidence, doubt = self._match_neighbours(snapshots, progress)
        prior = step_prior(self.config.step_deg or 360.0 / len(snapshots), self.config.step_sd_deg)
        scale = closing_scale(evidence, doubt, prior)
        seen = stretched(evidence, scale)
        steps = best_closed_steps(worth_of(seen, prior))
        made = self._paste(snapshots, scale, seen, prior, steps, named(snapshots, names))
        for first, second, gap in made.gaps:
            if gap > WIDEST_GAP * self.config.hfov_deg:
                raise GapTooWide((first, second), named(snapshots, names), made)
        return made

    def explain(self, snapshots: Sequence[Image], made: Panorama, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """Pictures of every insertion and of the whole circle (4.1.2): see ``sensors.panorama_pictures``."""
        from sensors.panorama_pictures import circle_picture, insertion_pictures

        half_view = float(wrap(made.heading - made.headings[0]))
        pictures = self._bent(snapshots, round(half_view / np.pi * made.image.shape[1]))
        yield from insertion_pictures(pictures, made, names, feathered)
        yield circle_picture(made, names, float(np.rad2deg(2.0 * half_view)))

    def _match_neighbours(
        self, snapshots: Sequence[Image], progress: Callable[[int], None] | None
    ) -> tuple[Floats, Floats]:
        """Evidence and doubt (S, columns) on each step from a snapshot to the next, the last to the first as well."""
        ready = [gradients(snapshot, self.config.hfov_deg) for snapshot in snapshots]
        evidence, doubt = [], []
        for done, (first, second) in enumerate(zip(ready, ready[1:] + ready[:1], strict=True), start=1):
            evidence.append(step_evidence(first, second))
            doubt.append(step_doubt(first, second))
            if progress is not None:
                progress(done)
        return np.stack(evidence), np.stack(doubt)

    def _bent(self, snapshots: Sequence[Image], width: int) -> list[Image]:
        """The snapshots as they are pasted: filtered, on the cylinder, so many columns wide, as high as they are.

        A frame has fewer columns a radian in its middle than at its edges. Its rows are scaled between the middle's and
        the mean: so incremental zoom finds a frame that was taken on the node there, to a centimetre or two.
        """
        rows, columns = snapshots[0].shape[:2]
        hfov = np.deg2rad(self.config.hfov_deg)
        middle, mean = columns / 2.0 / np.tan(hfov / 2.0), columns / hfov
        scale = (float(np.sqrt(middle * mean)), float(mean))
        bent = [
            on_cylinder(filtered(one, self.config), self.config.hfov_deg, (rows, columns), scale) for one in snapshots
        ]
        return bent if width == columns else [resize(one, width, rows) for one in bent]

    def _paste(
        self,
        snapshots: Sequence[Image],
        scale: float,
        seen: Floats,
        prior: Floats,
        steps: Ints,
        names: Sequence[str],
    ) -> Panorama:
        """The panorama of these steps (S,) and views so much wider than given, with what is to be told of it."""
        rows, across = snapshots[0].shape[:2]
        hfov_deg = scale * self.config.hfov_deg
        columns, width = Camera(self.config.hfov_deg, across, rows).panorama_columns(), round(scale * across)
        turned = np.deg2rad(RESOLUTION_DEG) * np.concatenate([[0], np.cumsum(steps)[:-1]])
        lefts = np.rint(turned / (2.0 * np.pi) * columns).astype(np.int64) % columns
        headings = wrap(np.deg2rad(self.config.start_deg) - turned)
        gaps = gaps_between(headings, hfov_deg)
        notes = (*_notes_on_gaps(gaps, names), *_notes_on_chance(seen, steps, names))
        if abs(scale - 1.0) > TOLD_SCALE:
            notes = (*notes, _note_on_view(hfov_deg, self.config.hfov_deg))
        return Panorama(
            feathered(self._bent(snapshots, width), lefts, columns),
            lefts,
            headings,
            float(wrap(headings[0] + np.pi * width / columns)),
            float(filled_columns(lefts, width, columns).mean()),
            gaps,
            notes,
            _reasons(seen, prior, steps),
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


def closing_scale(evidence: Floats, doubt: Floats, prior: Floats) -> float:
    """The factor, one of ``SCALES``, by which all steps that the pictures say must grow so that the circle closes.

    Columns on the cylinder are degrees by the field of view given: where that is too small by some factor, every step
    is too small by nearly the same one. The factor is the one whose closed circle is worth most, with a normal prior
    around 1; but a wider view and an unseen gap explain the same, and then there is a gap. [ours]

    Args:
        evidence: (S, n) of each pair, at steps by the field of view given.
        doubt: (S, n) what is lost where a pair does not match, see ``sensors.panorama_pairs.step_doubt``.
        prior: (C,) see ``step_prior``.

    Returns:
        1 where no more than half of the pairs show anything.
    """
    if 2 * int((evidence.max(axis=1) >= SHOWS_NOTHING).sum()) <= len(evidence):
        return 1.0
    doubted = np.log(np.expm1(evidence) + np.exp(doubt))  # as likely as the match is, or as a match that fails
    worths = []
    for scale in SCALES:
        worth = worth_of(stretched(doubted, scale), prior)
        coarse = maximum_filter1d(worth, COARSE, axis=1)[:, ::COARSE]
        closed = float(coarse[np.arange(len(coarse)), best_closed_steps(coarse)].sum())
        worths.append(closed - 0.5 * ((scale - 1.0) / SCALE_SD) ** 2 - (SCALE_GAIN if scale > 1.0 else 0.0))
    return SCALES[int(np.argmax(worths))]


def stretched(evidence: Floats, scale: float) -> Floats:
    """Evidence (S, n) at steps by one field of view, at those by another so many times as wide."""
    at = np.arange(int(evidence.shape[1] * scale)) / scale
    return np.stack([np.interp(at, np.arange(evidence.shape[1]), one) for one in evidence])


def _reasons(evidence: Floats, prior: Floats, steps: Ints) -> tuple[Insertion, ...]:
    """Why each snapshot stands where it does: its step from the one before, for the first one from the last."""
    candidates = np.asarray(np.arange(evidence.shape[1]) * RESOLUTION_DEG, dtype=np.float64)
    reasons = [
        Insertion(pair, candidates, seen, prior[: len(seen)], float(step * RESOLUTION_DEG))
        for pair, (seen, step) in enumerate(zip(evidence, steps, strict=True))
    ]
    return (reasons[-1], *reasons[:-1])


def _note_on_view(apparent_deg: float, given_deg: float) -> str:
    return (
        f"views seem {apparent_deg:.1f} degrees wide, not {given_deg:g}, since so the circle closes: correct hfov_deg, "
        f"unless the camera stands ahead of the axis that it turns about"
    )


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
