"""Colour histograms of whole views: small, fast, blind to where things stand in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sensors.images import Views
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap

BANDS = 6
"""Hue, lightness, saturation, and normalised red, green, blue (Ulrich & Nourbakhsh, whom the thesis cites)."""


@dataclass(frozen=True)
class ColorHistogramConfig(ViewConfig):
    """Settings of the histogram sensor.

    Attributes:
        bins: of each of the six bands.
        smoothing: share of a uniform histogram mixed in, so that an empty bin does not forbid anything.
    """

    bins: int = 24
    smoothing: float = 0.05
    slope: float = 2.4
    margin: float = -0.296

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bins < 2:
            raise ValueError(f"bins is {self.bins}; it must be at least 2")


class ColorHistogram(ViewSensor):
    """One histogram a view, compared by Jeffrey divergence; the nearest views are the hypotheses."""

    Config = ColorHistogramConfig

    def distances(self, queries: Floats, others: Floats) -> Floats:
        """Jeffrey divergences (Q, V), means over bands, of histograms (Q, BANDS, bins) from (V, BANDS, bins)."""
        return np.stack([jeffrey(one, others) for one in queries])

    def _views_of(self, topo_map: TopoMap) -> Views:
        views = super()._views_of(topo_map)
        if views.on_nodes and topo_map.filtered:
            raise UserError(
                f"map {topo_map.name!r}: its panoramas are filtered and have no colour for histogram to compare; "
                "make them with 'topoloc panorama --no-clahe'"
            )
        return views

    def describe(self, pictures: Pictures) -> Floats:
        """Histograms (BANDS, bins) of a frame's picture; each band sums to one."""
        image = pictures["rgb"]
        plain = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
        small = cv2.resize(
            plain, (96, max(1, round(96 * plain.shape[0] / plain.shape[1]))), interpolation=cv2.INTER_AREA
        )
        hls = cv2.cvtColor(small, cv2.COLOR_RGB2HLS).reshape(-1, 3) / np.array([180.0, 256.0, 256.0])
        rgb = small.reshape(-1, 3).astype(np.float64)
        share = rgb / (rgb.sum(axis=1, keepdims=True) + 1.0)
        bands = np.concatenate([hls, share], axis=1).T  # (BANDS, pixels), each in [0, 1)
        cell = (bands * self.config.bins).astype(np.int64) + self.config.bins * np.arange(BANDS)[:, None]
        counts = np.bincount(cell.ravel(), minlength=BANDS * self.config.bins).reshape(BANDS, self.config.bins)
        uniform = self.config.smoothing / self.config.bins
        return np.asarray((1.0 - self.config.smoothing) * counts / len(rgb) + uniform)


def jeffrey(one: Floats, others: Floats) -> Floats:
    """Jeffrey divergence (V,) between histograms (B, n) and (V, B, n), mean over the bands; 0 where they are equal."""
    mean = (one + others) / 2.0
    return np.asarray((one * np.log(one / mean) + others * np.log(others / mean)).sum(axis=2).mean(axis=1))
