"""Colour histograms of whole views: small, fast, blind to where things stand in the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.images import Views
from sensors.nearest import UNIT, ByProduct, Floats32, Search
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, Ints

MOST_BINS = 1024
"""There are 256 levels; more bins than this would only be emptier."""
BANDS = 6
"""Hue, lightness, saturation, and normalised red, green, blue (Ulrich & Nourbakhsh, whom the thesis cites)."""
WIDTH = 96
"""Columns that pictures are scaled down to."""
BATCH = 4096
"""Views that are compared at a time, so that memory does not grow with the map."""

Histograms = NDArray[Any]
"""float32: half the time of double, and exact to 1e-5."""
Voting = Literal["none", "unanimous"]
Verdict = Literal["confident", "uncertain", "confused"]


@dataclass(frozen=True)
class ColorHistogramConfig(ViewConfig):
    """Settings of the histogram sensor.

    Attributes:
        bins: of each of the six bands.
        smoothing: share of a uniform histogram mixed in, so that an empty bin does not forbid anything.
        voting: ``none``: the views whose bands are nearest in the mean are the hypotheses; ``unanimous``: each band
            votes for a node, and the sensor says something only where all votes that count name the same.
        least_confidence: of a band's vote that counts, 0 to 1.
    """

    bins: int = 24
    smoothing: float = 0.05
    voting: Voting = "none"
    least_confidence: float = 0.2
    slope: float = 2.4
    margin: float = -0.296

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 2 <= self.bins <= MOST_BINS:
            raise ValueError(f"bins is {self.bins}; it must lie between 2 and {MOST_BINS}")
        if not 0.0 < self.smoothing < 1.0:
            raise ValueError(f"smoothing is {self.smoothing}; it must lie between 0 and 1")
        if self.voting not in ("none", "unanimous"):
            raise ValueError(f"voting is {self.voting!r}; it must be none or unanimous")
        if not 0.0 <= self.least_confidence <= 1.0:
            raise ValueError(f"least_confidence is {self.least_confidence}; it must lie between 0 and 1")


@dataclass(frozen=True)
class Votes:
    """Where each band of a frame would have the robot (Ulrich & Nourbakhsh, ICRA 2000).

    A band votes for the node of its nearest reference view. That its confidence is one less the ratio of that distance
    to the one to the nearest view of any other node is rebuilt: the paper was not at hand.

    Attributes:
        nodes: (BANDS,) index of the node that each votes for.
        confidence: (BANDS,) of each, 0 (another node is as near) to 1.
    """

    nodes: Ints
    confidence: Floats

    def verdict(self, least_confidence: float) -> Verdict:
        """``confident`` where all votes that count name one node, ``confused`` where they do not agree.

        ``uncertain`` where none counts: none has the least confidence.
        """
        counting = self.nodes[self.confidence >= least_confidence]
        if len(counting) == 0:
            return "uncertain"
        return "confident" if (counting == counting[0]).all() else "confused"

    def leader(self) -> int:
        """The node with the most confidence."""
        return int(np.bincount(self.nodes, weights=self.confidence).argmax())


class ColorHistogram(ViewSensor):
    """One histogram a band and view, compared by Jeffrey divergence; the nearest views are the hypotheses.

    With ``voting=unanimous`` bands vote one by one, as published; how votes become evidence is ours: where the verdict
    is confident, the nearest views of that node are the hypotheses, else the frame is blind.
    """

    Config = ColorHistogramConfig
    name = "histogram"
    config: ColorHistogramConfig

    def observe_many(self, frames: Sequence[Frame]) -> list[Evidence]:
        """The nearest views as hypotheses; blind without contrast, and where bands are to be unanimous and are not."""
        if self.config.voting == "none" or self._views is None:
            return super().observe_many(frames)
        return [self._voted(frame) for frame in frames]

    def _voted(self, frame: Frame) -> Evidence:
        if self._is_blind(frame.images):
            return Evidence.blind()
        seen = self.describe(frame.images)
        votes = self._votes(seen)
        if votes.verdict(self.config.least_confidence) != "confident":
            return Evidence.blind()
        own = np.flatnonzero(self._neighbourhood.nodes == votes.leader())
        distance = self.distances(seen[None], self._descriptors[own])[0]
        nearest = self._neighbourhood.nearest(distance)
        return self._evidence(own[nearest], distance[nearest], frame)

    def votes(self, image: Image) -> Votes:
        """What each band of a frame's picture votes for, whatever ``voting`` is set to."""
        if self._views is None:
            raise RuntimeError("ColorHistogram knows no map yet: call fit(topo_map) before votes(image)")
        return self._votes(self.describe({"rgb": image}))

    def _votes(self, seen: Histograms) -> Votes:
        return votes_of(band_divergences(seen, self._descriptors), self._neighbourhood.nodes)

    def distances(self, queries: Histograms, others: Histograms) -> Floats:
        """Jeffrey divergences (Q, V), means over the bands, between what ``describe`` gives (Q, ...) and (V, ...)."""
        return np.stack([divergences(one, others) for one in queries])

    def _key(self) -> object:
        return 1, self.config.bins, self.config.smoothing

    def _search_of(self, descriptors: Histograms) -> Search:
        return Jeffrey(descriptors)

    def _views_of(self, topo_map: TopoMap) -> Views:
        views = super()._views_of(topo_map)
        if views.on_nodes and topo_map.filtered:
            raise UserError(
                f"map {topo_map.name!r}: its panoramas are filtered and have no colour for histogram to compare; "
                "make them with 'topoloc panorama --no-clahe'"
            )
        return views

    def describe(self, pictures: Pictures) -> Histograms:
        """What a frame's picture is compared by: see ``described``."""
        image = pictures["rgb"]
        plain = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
        rows = max(1, round(WIDTH * plain.shape[0] / plain.shape[1]))
        small = cv2.resize(plain, (WIDTH, rows), interpolation=cv2.INTER_AREA)
        hls = cv2.LUT(cv2.cvtColor(small, cv2.COLOR_RGB2HLS), _bins_of_levels(self.config.bins))
        levels = small.astype(np.int32)
        sums = levels[..., 0] + levels[..., 1] + levels[..., 2]  # a third of the time of numpy.sum
        shares = _bins_of_shares(self.config.bins).take(256 * sums[..., None] + levels)
        size, ends = [self.config.bins], [0, self.config.bins]
        counts = [cv2.calcHist([bands], [k], None, size, ends).ravel() for bands in (hls, shares) for k in range(3)]
        uniform = self.config.smoothing / self.config.bins
        return described((1.0 - self.config.smoothing) * np.array(counts, np.float64) / sums.size + uniform)


@lru_cache(maxsize=4)
def _bins_of_levels(bins: int) -> NDArray[Any]:
    """Bin (1, 256, 3) of each level of hue, lightness and saturation, as OpenCV has them: hue 180 is hue 0."""
    levels = np.arange(256)[:, None]
    share = np.concatenate([levels % 180 / 180.0, levels / 256.0, levels / 256.0], axis=1)
    return np.asarray(share * bins).astype(np.min_scalar_type(bins - 1))[None]


@lru_cache(maxsize=4)
def _bins_of_shares(bins: int) -> NDArray[Any]:
    """Bin (766 * 256,) of a colour's share by the sum of the three levels, times 256, plus its own level."""
    share = np.minimum(np.arange(256.0), np.arange(766.0)[:, None]) / (np.arange(766.0)[:, None] + 1.0)
    return np.asarray(share * bins).astype(np.min_scalar_type(bins - 1)).ravel()


def described(histograms: Floats) -> Histograms:
    """Histograms (BANDS, bins), positive, each band summing to one, and what of their divergences is theirs alone.

    Returns:
        (BANDS * (bins + 1),), float32: the histograms, band after band, then sum h log h of each band.
    """
    own = (histograms * np.log(histograms)).sum(axis=1)
    return np.concatenate([histograms.ravel(), own]).astype(np.float32)


def divergences(one: Histograms, others: Histograms) -> Floats:
    """Jeffrey divergences (V,), means over the bands, between what ``described`` makes: (D,) or (V, D) and (V, D).

    With the mean m of histograms h and k, sum h log(h / m) + k log(k / m) = sum h log h + sum k log k - sum (h + k)
    log(h + k) + 2 log 2: one logarithm for each bin of each view; the other two sums are in ``described``.
    """
    bins = others.shape[1] - BANDS
    ones = np.broadcast_to(one, others.shape)
    own = ones[:, bins:].sum(axis=1) + others[:, bins:].sum(axis=1, dtype=np.float64)
    both = np.empty(len(others))
    for first in range(0, len(others), BATCH):
        total = others[first : first + BATCH, :bins] + ones[first : first + BATCH, :bins]
        both[first : first + BATCH] = np.vecdot(total, np.log(total))
    return np.asarray(np.maximum((own - both) / BANDS + 2.0 * np.log(2.0), 0.0))


class Jeffrey(ByProduct):
    """By the Jeffrey divergence, which no product gives, but one of square roots bounds it from both sides.

    For each bin h log(h / m) + k log(k / m) lies between log 2 and 1 times (sqrt h - sqrt k)^2 (ours): the quotient
    depends on h / k alone, is 1 where both are equal, and falls to log 2 where one is 0. Over a band, of sum 1, the
    square adds up to 2 - 2 sum sqrt h sqrt k.

    Args:
        views: (V, D), as ``described`` makes them; kept as they are.
    """

    def __init__(self, views: Histograms) -> None:
        self._views, self._bins = views, views.shape[1] - BANDS
        super().__init__(np.ascontiguousarray(np.sqrt(views[:, : self._bins]).T))

    def left(self, queries: Histograms) -> Floats32:
        """See ``ByProduct``: so that a figure is the mean over the bands of sum (sqrt h - sqrt k)^2, less 2."""
        return np.asarray(np.sqrt(queries[:, : self._bins]) * np.float32(-2.0 / BANDS))

    def reach(self, queries: Histograms, figure: Floats) -> Floats:
        """See ``ByProduct``.

        A figure has D terms that add up to 2 at most, a divergence as many that add up to the entropies, none of which
        is above 1 + log(bins of a band); what was rounded besides counts as 8 more.
        """
        unit = (self._bins + 8) * UNIT
        off = 2.0 * unit, 2.0 * (1.0 + np.log(self._bins / BANDS)) * unit
        return np.asarray((figure + 2.0 + off[0] + 2.0 * off[1]) / np.log(2.0) - 2.0 + off[0])

    def exact(self, queries: Histograms, views: Ints) -> Floats:
        """See ``ByProduct``."""
        return divergences(queries, self._views[views])


def band_divergences(one: Histograms, others: Histograms) -> Floats:
    """The same of each band (V, BANDS)."""
    bins = one.size - BANDS
    total = (others[:, :bins] + one[:bins]).reshape(len(others), BANDS, -1)
    both = np.vecdot(total, np.log(total)).astype(np.float64)
    return np.asarray(np.maximum(one[bins:] + others[:, bins:] - both + 2.0 * np.log(2.0), 0.0))


def votes_of(distances: Floats, nodes: Ints) -> Votes:
    """What bands vote for, by their distances (V, BANDS) to views of nodes (V,)."""
    nearest = distances.argmin(axis=0)
    voted = nodes[nearest]
    first = distances[nearest, np.arange(distances.shape[1])]
    second = np.where(nodes[:, None] == voted, np.inf, distances).min(axis=0)
    return Votes(voted, 1.0 - first / np.maximum(second, np.finfo(float).tiny))
