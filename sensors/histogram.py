"""Colour histograms of whole views: small, fast, blind to where things stand in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.images import Views
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

    def observe(self, frame: Frame) -> Evidence:
        """The nearest views as hypotheses; blind without contrast, and where bands are to be unanimous and are not."""
        if self.config.voting == "none" or self._views is None or self._is_blind(frame.images):
            return super().observe(frame)
        seen = self.describe(frame.images)
        votes = self._votes(seen)
        if votes.verdict(self.config.least_confidence) != "confident":
            return Evidence.blind()
        own = np.flatnonzero(self._neighbourhood.nodes == votes.leader())
        distance = self.distances(seen[None], self._descriptors[own])[0]
        nearest = self._neighbourhood.nearest(distance)
        poses = self._views.camera_poses(own[nearest], frame.camera)
        return self._neighbourhood.evidence(own[nearest], distance[nearest], poses)

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
        hls = cv2.cvtColor(small, cv2.COLOR_RGB2HLS).reshape(-1, 3) / np.array([180.0, 256.0, 256.0])
        rgb = small.reshape(-1, 3).astype(np.float64)
        share = rgb / (rgb.sum(axis=1, keepdims=True) + 1.0)
        bands = np.concatenate([hls, share], axis=1).T  # (BANDS, pixels), each in [0, 1)
        cell = (bands * self.config.bins).astype(np.int64) + self.config.bins * np.arange(BANDS)[:, None]
        counts = np.bincount(cell.ravel(), minlength=BANDS * self.config.bins).reshape(BANDS, self.config.bins)
        uniform = self.config.smoothing / self.config.bins
        return described((1.0 - self.config.smoothing) * counts / len(rgb) + uniform)


def described(histograms: Floats) -> Histograms:
    """Histograms (BANDS, bins), positive, each band summing to one, and what of their divergences is theirs alone.

    Returns:
        (BANDS * (bins + 1),), float32: the histograms, band after band, then sum h log h of each band.
    """
    own = (histograms * np.log(histograms)).sum(axis=1)
    return np.concatenate([histograms.ravel(), own]).astype(np.float32)


def divergences(one: Histograms, others: Histograms) -> Floats:
    """Jeffrey divergences (V,), means over the bands, between what ``described`` makes: (D,) and (V, D).

    With the mean m of histograms h and k, sum h log(h / m) + k log(k / m) = sum h log h + sum k log k - sum (h + k)
    log(h + k) + 2 log 2: one logarithm for each bin of each view; the other two sums are in ``described``.
    """
    bins = one.size - BANDS
    own = one[bins:].sum() + others[:, bins:].sum(axis=1, dtype=np.float64)
    both = np.empty(len(others))
    for first in range(0, len(others), BATCH):
        total = others[first : first + BATCH, :bins] + one[:bins]
        both[first : first + BATCH] = np.vecdot(total, np.log(total))
    return np.asarray(np.maximum((own - both) / BANDS + 2.0 * np.log(2.0), 0.0))


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
