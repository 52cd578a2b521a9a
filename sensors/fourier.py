"""The Fourier signature of full circles: a place by the moduli, a heading by the phases (third seed, section 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sensors.homomorphic import HomomorphicConfig, Pixels32, homomorphic
from sensors.images import MOST_COLUMNS, camera_on_nodes, deviation, grey, resize
from sensors.nearest import Euclid
from sensors.neighbourhood import BASE_MATCH, NeighbourConfig, Neighbourhood, Weighting
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.map_store import precomputed
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Evidence, Frame, Image, Ints

Signatures = NDArray[np.complex64]


@dataclass(frozen=True)
class FourierSignatureConfig(NeighbourConfig):
    """Settings of the Fourier signature.

    Neighbours are weighed by rank: under other light than the map's every distance grows, and their order stays.

    Attributes:
        columns: that every full circle is scaled to; the rows keep the aspect of the map's panoramas. 256 in the seed.
        rows: of the signature: neighbouring rows of the filtered picture are averaged, down to so many.
        components: F, Fourier coefficients that are kept of each row, the mean among them.
        blind_deviation: a picture whose grey levels deviate less says nothing: a covered lens [grey levels].
        homomorphic: the filter against changes of the light.
    """

    weighting: Weighting = "rank"
    kappa: float = 50.0
    columns: int = 256
    rows: int = 28
    components: int = 12
    blind_deviation: float = 6.0
    homomorphic: HomomorphicConfig = field(default_factory=HomomorphicConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows < 1:
            raise ValueError(f"rows is {self.rows}; it must be at least 1")
        if self.columns > MOST_COLUMNS:
            raise ValueError(f"columns is {self.columns}; it must be at most {MOST_COLUMNS}")
        if not 2 <= self.components <= self.columns // 2:
            raise ValueError(f"components is {self.components}; it must lie between 2 and half of columns")


class FourierSignature:
    """One signature a panorama; the nodes of the nearest ones are the hypotheses, each with a heading of its own.

    A robot that turns shifts the columns of its full circle, which changes the phases of each row's Fourier
    coefficients and not their moduli.
    """

    Config = FourierSignatureConfig
    needs = frozenset({"omni"})
    base_match = BASE_MATCH

    def __init__(self, config: FourierSignatureConfig | None = None) -> None:
        self.config = config or FourierSignatureConfig()
        self._neighbourhood: Neighbourhood | None = None

    def fit(self, topo_map: TopoMap) -> None:
        """Signatures of the map's panoramas, and the scale of their distances.

        Raises:
            UserError: the map has no panoramas, or filtered ones, which its frames are not.
        """
        nodes = [node for node in topo_map.nodes if node.has_panorama]
        if not nodes:
            raise UserError(f"map {topo_map.name!r}: fourier compares panoramas, and no node has one; add some")
        if topo_map.filtered:
            raise UserError(
                f"map {topo_map.name!r}: its panoramas are filtered, and omni frames are not; fourier needs plain "
                "ones: make them with 'topoloc panorama --no-clahe'"
            )
        camera = topo_map.camera
        self._size = _size(self.config.columns, camera.height, camera.panorama_columns())
        self._poses = np.array([(node.x, node.y, node.heading) for node in nodes])
        key = 1, self.config.columns, self.config.rows, self.config.components, self.config.homomorphic
        known = precomputed(topo_map, "fourier", key, lambda: {"signatures": self._signatures_of(nodes)})
        self._signatures: Signatures = known["signatures"]
        self._moduli = Moduli(self._signatures)
        self._neighbourhood = Neighbourhood(topo_map, self._poses, self._between, self.config, with_heading=False)

    def observe(self, frame: Frame) -> Evidence:
        """The nearest panoramas as hypotheses; blind for a picture without contrast."""
        return self.observe_many([frame])[0]

    def observe_many(self, frames: Sequence[Frame]) -> list[Evidence]:
        """What ``observe`` says of each frame; comparing all with the panoramas at once is faster."""
        if self._neighbourhood is None:
            raise RuntimeError("FourierSignature knows no map yet: call fit(topo_map) before observe(frame)")
        images = [frame.images["omni"] for frame in frames]
        readable = [deviation(image) >= self.config.blind_deviation for image in images]
        if not any(readable):
            return [Evidence.blind() for _ in frames]
        seen = [self._signature(image, self._size) for image, told in zip(images, readable, strict=True) if told]
        found = zip(*self._nearest(np.stack(seen)), strict=True)
        return [
            self._evidence(*next(found), frame) if told else Evidence.blind()
            for frame, told in zip(frames, readable, strict=True)
        ]

    def _nearest(self, seen: Signatures) -> tuple[Ints, Floats, Floats]:
        """Of Q signatures: the nearest panoramas (Q, J), their distances, and the columns turned since [columns]."""
        assert self._neighbourhood is not None
        chosen, distance = self._moduli.nearest(moduli(seen), self._neighbourhood.count)
        return chosen, distance, columns_turned(self._signatures[chosen], seen[:, None], self.config.columns)

    def _evidence(self, chosen: Ints, distance: Floats, turned: Floats, frame: Frame) -> Evidence:
        """Of the nearest panoramas (J,), their distances, and the columns turned since, for a frame."""
        assert self._neighbourhood is not None
        poses = self._camera_poses(chosen, turned * 2.0 * np.pi / self.config.columns, frame.camera)
        return self._neighbourhood.evidence(chosen, distance, poses)

    def distances_between(self, images: Sequence[Image]) -> Floats:
        """Distances (N, N) of full circles among each other, without a map; all are scaled to the first one's size."""
        size = _size(self.config.columns, *images[0].shape[:2])
        signatures = np.stack([self._signature(image, size) for image in images])
        return Moduli(signatures).distances(signatures)

    def _signatures_of(self, nodes: Sequence[Node]) -> Signatures:
        """(V, rows, components) of nodes that have panoramas."""
        panoramas = (node.panorama for node in nodes)
        return np.stack([self._signature(panorama, self._size) for panorama in panoramas if panorama is not None])

    def _signature(self, image: Image, size: tuple[int, int]) -> Signatures:
        """(rows, components) of a full circle, scaled to ``size``, rows and columns."""
        small = resize(grey(image), size[1], size[0])
        settings = self.config.homomorphic
        picture = homomorphic(small, settings) if settings.on else small.astype(np.float32)
        return signature(averaged(picture, self.config.rows), self.config.components)

    def _between(self, rows: Ints) -> Floats:
        return self._moduli.distances(self._signatures[rows])

    def _camera_poses(self, chosen: Ints, turned: Floats, mount: Floats) -> Floats:
        """Poses (J, 3) of a camera at ``mount`` (3,) that has turned by ``turned`` (J,) since the panoramas [rad].

        A full circle is taken at once: the robot's axis stood on the node then, and its camera looked along the
        panorama's first column.
        """
        poses = self._poses[chosen]
        cameras = camera_on_nodes(poses[:, :2], poses[:, 2], mount)
        return np.column_stack([cameras[:, :2], wrap(poses[:, 2] + turned)])


class Moduli(Euclid):
    """Moduli of signatures (V, rows, components), to be compared with those of others: Euclid over all of them."""

    def __init__(self, signatures: Signatures) -> None:
        super().__init__(moduli(signatures))

    def distances(self, signatures: Signatures) -> Floats:
        """Distances (Q, V) of others (Q, rows, components), by one product of matrices, in float32."""
        return self.roughly(moduli(signatures))


def moduli(signatures: Signatures) -> Pixels32:
    """(N, rows * components) of signatures (N, rows, components)."""
    return np.asarray(np.abs(signatures).reshape(len(signatures), -1))


def signature(picture: Pixels32, components: int) -> Signatures:
    """The first Fourier coefficients (rows, components) of each row of a full circle (rows, columns).

    A_k = sum_n a_n exp(-2 pi i k n / N) for k < F (third seed, section 2). Columns shifted right by q multiply it by
    exp(-2 pi i k q / N).
    """
    return np.asarray(fft.rfft(picture, axis=1)[:, :components])


def columns_turned(references: Signatures, seen: Signatures, columns: int) -> Floats:
    """By how many columns (...) full circles are shifted to the right against others, in [-0.5, columns - 0.5].

    That is how far the robot has turned counter-clockwise since they were taken, in columns: columns run clockwise.
    The shift q is where Re sum_rows sum_{1 <= k < F} A_k conj(B_k) exp(-2 pi i k q / N) is largest (EQUATIONS.md, 3;
    ours): one inverse FFT gives every q, a parabola through the best and its neighbours the part of a column.

    Args:
        references: (..., rows, components), A.
        seen: (..., rows, components), B; shapes are broadcast.
        columns: N of the circle.
    """
    cross = np.einsum("...rk,...rk->...k", references.conj(), seen)
    cross[..., 0] = 0.0  # the mean says nothing of the heading
    match = fft.irfft(cross, columns, axis=-1)
    best = match.argmax(axis=-1)[..., None]
    before, peak, after = (np.take_along_axis(match, (best + step) % columns, axis=-1)[..., 0] for step in (-1, 0, 1))
    bend = np.maximum(2.0 * peak - before - after, np.finfo(np.float32).tiny)
    return np.asarray(best[..., 0] + 0.5 * (after - before) / bend, dtype=np.float64)


def averaged(picture: Pixels32, rows: int) -> Pixels32:
    """A picture (R, columns) with neighbouring rows averaged to ``rows`` of them; as it is where it has no more.

    Where R is no multiple of ``rows``, a row that lies on a border counts on both sides by its share.
    """
    height = len(picture)
    return picture if height <= rows else np.asarray(_shares(height, rows) @ picture)


@lru_cache(maxsize=8)
def _shares(height: int, rows: int) -> Pixels32:
    """(rows, height), what each of ``height`` rows counts for in each of ``rows`` averages."""
    edges = np.arange(rows + 1)[:, None] * height / rows
    covered = np.clip(edges - np.arange(height), 0.0, 1.0)  # of each row, above each edge
    return np.asarray(np.diff(covered, axis=0) * rows / height, dtype=np.float32)


def _size(columns: int, height: int, width: int) -> tuple[int, int]:
    """Rows and columns of a picture of ``height`` x ``width`` scaled to so many columns."""
    return max(1, round(columns * height / width)), columns
