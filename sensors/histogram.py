"""Colour histograms of whole views: small, fast, blind to where things stand in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sensors.calibration import log_density, match_of, wrong_distance
from sensors.images import Views, grey, views_of
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image

BANDS = 6
"""Hue, lightness, saturation, and normalised red, green, blue (Ulrich & Nourbakhsh, whom the thesis cites)."""


@dataclass(frozen=True)
class ColorHistogramConfig:
    """Settings of the histogram sensor.

    Attributes:
        bins: of each of the six bands.
        smoothing: share of a uniform histogram mixed in, so that an empty bin does not forbid anything.
        neighbours: views that become hypotheses.
        blind_deviation: a picture whose grey levels deviate less says nothing: a covered lens [grey levels].
        slope: log-likelihood ratio per unit of match; this and the next from ``benchmarks/calibration.py``.
        margin: match above 0.5 at which the ratio is 1.
        sigma_m: how far around a view a match holds [m].
        kappa: concentration of the heading around a view's.
        log_floor: log-likelihood ratio that remains far from every hypothesis.
    """

    bins: int = 24
    smoothing: float = 0.05
    neighbours: int = 10
    blind_deviation: float = 6.0
    slope: float = 2.4
    margin: float = -0.296
    sigma_m: float = 0.6
    kappa: float = 20.0
    log_floor: float = -1.5

    def __post_init__(self) -> None:
        if self.bins < 2 or self.neighbours < 1:
            raise ValueError("bins must be at least 2 and neighbours at least 1")
        if self.sigma_m <= 0.0 or self.kappa < 0.0:
            raise ValueError("sigma_m must be positive, and kappa not negative")


class ColorHistogram:
    """One histogram a view, compared by Jeffrey divergence; the nearest views are the hypotheses."""

    Config = ColorHistogramConfig
    needs = frozenset({"rgb"})
    base_match = 0.5

    def __init__(self, config: ColorHistogramConfig | None = None) -> None:
        self.config = config or ColorHistogramConfig()
        self._views = Views(np.zeros((0, 3)), [], on_nodes=False)

    def fit(self, topo_map: TopoMap) -> None:
        """Histograms of the map's views, or of views cut from its panoramas.

        Raises:
            UserError: the map has neither, or its panoramas are filtered and so without colour.
        """
        self._views = views_of(topo_map)
        if not self._views.images:
            raise UserError(f"map {topo_map.name!r}: histogram needs training views or panoramas; add either")
        if self._views.on_nodes and topo_map.filtered:
            raise UserError(
                f"map {topo_map.name!r}: its panoramas are filtered and have no colour for histogram to compare; "
                "make them with 'topoloc panorama --no-clahe'"
            )
        self._nodes = topo_map.nearest_node(self._views.poses[:, :2])
        self._signatures = np.stack([self._signature(image) for image in self._views.images])
        distances = np.stack([jeffrey(one, self._signatures) for one in self._signatures])
        self._wrong = wrong_distance(distances, self._nodes)
        self._log_density = log_density(self._views.poses, self.config.sigma_m, self.config.kappa)

    def observe(self, frame: Frame) -> Evidence:
        """The nearest views as hypotheses; blind for a picture without contrast."""
        if not self._views.images:
            raise RuntimeError("ColorHistogram knows no map yet: call fit(topo_map) before observe(frame)")
        image = frame.images["rgb"]
        if float(grey(image).std()) < self.config.blind_deviation:
            return Evidence.blind()
        distance = jeffrey(self._signature(image), self._signatures)
        nearest = np.argsort(distance, kind="stable")[: self.config.neighbours]
        match = match_of(distance[nearest], self._wrong)
        ratio = self.config.slope * (match - self.base_match - self.config.margin)
        count = len(nearest)
        return Evidence(
            poses=self._views.camera_poses(nearest, frame.camera),
            nodes=self._nodes[nearest],
            match=match,
            distance=distance[nearest] / max(self._wrong, np.finfo(float).tiny),
            log_likelihoods=ratio - self._log_density[nearest],
            sigma=np.full(count, self.config.sigma_m),
            kappa=np.full(count, self.config.kappa),
            log_floor=self.config.log_floor,
        )

    def _signature(self, image: Image) -> Floats:
        """(BANDS, bins), each band sums to one."""
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
