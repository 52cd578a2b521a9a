"""IMA, the thesis's image matching (chapter 2): slots of a frame found, in order, on a node's panorama."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sensors.coarse_stage import CoarseStage
from sensors.digital_zoom import advances_of, best_of, scaled
from sensors.images import camera_on_nodes, clahe, cut_views, grey
from sensors.slot_correlation import KEPT_MB, Reference, make_reference
from sensors.slot_matching import Matches, Sums, match_frames, slot_values, sums_of_winners
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.map_store import precomputed
from topoloc.thesis import THESIS
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Evidence, Frame, Image, Ints, Pixels

SAME_PLACE_M = 0.1
"""Nodes nearer to each other than this are one place photographed twice [m]: it counts once."""
PREPARED = 1
"""Number of the way in which panoramas are prepared; another one makes what maps' folders keep stale."""
ONLY_FOR_LOOKS = frozenset(
    {
        "scene_m",
        "blind_deviation",
        "slope",
        "margin",
        "sigma_m",
        "kappa",
        "kappa_fall",
        "sure_margin",
        "log_floor",
        "memory_mb",
        "candidates",
    }
)
"""Settings that what is precomputed of a map does not depend on."""
MATCHED_FOR_A_CANDIDATE = 4
"""Panoramas that are matched in the time of one candidate, whose transforms are not kept, the coarse stage included."""
CALIBRATION_NODES, CALIBRATION_STRIDE, CALIBRATION_OTHERS = 16, 4, 64
"""``fit`` matches views of at most so many nodes, of each one direction in so many, with at most so many others."""


@dataclass(frozen=True)
class IMAConfig:
    """Settings of IMA: the first four are the thesis's (4.1.1, 5.2), the two of CLAHE belong to them but are not given.

    Attributes:
        scale_columns: columns of a scaled frame; the rows keep the frame's aspect.
        slots: column regions N_s that a frame is divided into.
        zoom: digital zoom rho_in, the largest that is tried; 1 matches without zoom.
        zoom_steps: zooms tried each way; 1 is the thesis's fixed zoom, more are incremental zoom (2.4.3, 6.2), spaced
            so that each stands for the same further displacement (2.5).
        scene_m: distance D of what is seen in (2.5): by it the best zoom places a hypothesis before or behind its
            node, along the heading; 0 leaves it on the node, as published [m].
        clahe: filter grey full-size pictures with CLAHE before scaling.
        clahe_clip_limit: OpenCV's clip limit.
        clahe_tiles: tiles along each side of a frame.
        flat_variance: a slot or region whose grey levels vary less has no correlation [grey level^2]. The default is
            the variance that rounding to whole grey levels alone makes.
        blind_deviation: a scaled picture whose grey levels deviate less says nothing: a covered lens [grey levels].
        slope: log-likelihood ratio per unit of match; this and the next from ``benchmarks/calibration.py``.
        margin: match above the mean of wrong nodes at which the ratio is 1.
        sigma_m: how far around a node a match holds [m].
        kappa: concentration of the heading that the matched column of a sure match gives; no more, since the looks
            from one side of a node err alike.
        kappa_fall: how fast its log falls with the match below that, per unit: a poor match finds some column all the
            same. This and the next from ``benchmarks/calibration.py``.
        sure_margin: match above the mean of wrong nodes from which on a match is sure.
        log_floor: log-likelihood ratio that remains far from every node.
        memory_mb: memory for what is precomputed of the panoramas beside their scaled pictures: with the defaults 0.3
            MB a node. What finds no room is made anew at each look, which takes three times as long [MB].
        candidates: nodes that a coarse stage leaves to be matched, for maps of thousands of nodes; the others get no
            hypothesis. 0: all are matched, and so they are on maps of less than four times as many nodes, where that
            is faster. The coarse stage has up to 512 MB of its own.
    """

    scale_columns: int = THESIS.scale_columns
    slots: int = THESIS.slots
    zoom: float = THESIS.zoom
    zoom_steps: int = 1
    scene_m: float = 0.0
    clahe: bool = THESIS.clahe
    clahe_clip_limit: float = THESIS.clahe_clip_limit
    clahe_tiles: int = THESIS.clahe_tiles
    flat_variance: float = 1.0 / 12.0
    blind_deviation: float = 2.0
    slope: float = 12.7
    margin: float = 0.072
    sigma_m: float = 0.4
    kappa: float = 50.0
    kappa_fall: float = 18.1
    sure_margin: float = 0.181
    log_floor: float = -1.5
    memory_mb: float = KEPT_MB
    candidates: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.slots <= self.scale_columns:
            raise ValueError(f"slots is {self.slots}; it must lie between 1 and scale_columns")
        if not 1.0 <= self.zoom < 2.0:
            raise ValueError(f"zoom is {self.zoom}; it must be at least 1 and less than 2")
        if self.zoom_steps < 1 or self.scene_m < 0.0:
            raise ValueError("zoom_steps must be at least 1, and scene_m not negative")
        if self.clahe_tiles < 1 or self.clahe_clip_limit <= 0.0:
            raise ValueError("clahe_tiles must be at least 1, and clahe_clip_limit positive")
        if self.candidates < 0:
            raise ValueError(f"candidates is {self.candidates}; it must be at least 1, or 0 for all nodes")
        if self.sigma_m <= 0.0 or min(self.kappa, self.kappa_fall, self.flat_variance, self.memory_mb) < 0.0:
            raise ValueError("sigma_m must be positive, kappa, kappa_fall, flat_variance and memory_mb not negative")


@dataclass(frozen=True)
class SlotMatches:
    """Where IMA's answer for one panorama has each slot of the frame, from left to right.

    Attributes:
        left: (N_s,) left edges, shares of the full circle from the panorama's first column on, clockwise, in [0, 1).
        width: of a slot, share of the full circle.
        value: (N_s,) correlation of each slot there, in [0, 1].
        counted: (N_s,) whether the slot adds to the answer there: in Code 2.2, if it beats the others (MATCH_SLOT).
        match: of the panorama, as ``Evidence.match`` has it.
    """

    left: Floats
    width: float
    value: Floats
    counted: NDArray[np.bool_]
    match: float


class IMA:
    """The sensor model of the thesis: IMA against every node's panorama, with digital zoom (2.4.2, 4.1.5).

    Evidence has one hypothesis a node, or one for each of the ``candidates``; ``match`` is IMA's own value. How good a
    match is depends on how alike the nodes of a map look: ``fit`` measures what wrong nodes give, by views cut from
    each panorama and matched against all the others, and the log-likelihood is linear in the match above that.
    """

    Config: ClassVar[type[IMAConfig]] = IMAConfig
    needs = frozenset({"rgb"})
    store: ClassVar[str] = "ima"
    """Under this name a map's folder keeps what is precomputed (``topoloc.map_store``)."""
    unrelated_match: ClassVar[float] = 0.43
    """95th percentile of IMA with 8 slots between unrelated pictures: what a map of one node is held against."""

    def __init__(self, config: IMAConfig | None = None) -> None:
        self.config = config or IMAConfig()
        self._advances = advances_of(self.config.zoom, self.config.zoom_steps)
        self._references: list[Reference] = []
        self._coarse: CoarseStage | None = None

    def fit(self, topo_map: TopoMap) -> None:
        """Prepare every panorama, plain and zoomed in, and measure how alike wrong nodes look.

        Raises:
            UserError: a node has no panorama.
        """
        lacking = [node.id for node in topo_map.nodes if not node.has_panorama]
        if lacking:
            names = ", ".join(lacking[:5]) + (f" and {len(lacking) - 5} more" if len(lacking) > 5 else "")
            remedy = f"add one for {names}, or choose another one: --sensor local or pca, which use training views"
            raise UserError(f"map {topo_map.name!r}: ima needs a panorama at every node; {remedy}")
        self._camera, self._filtering = topo_map.camera, self.config.clahe and not topo_map.filtered
        self._positions = topo_map.positions
        self._headings = np.array([node.heading for node in topo_map.nodes])
        self._density = cKDTree(self._positions).query_ball_point(self._positions, SAME_PLACE_M, return_length=True)
        self._rows = max(1, round(self.config.scale_columns * self._camera.height / self._camera.width))
        known = self._known_of(topo_map)
        self._references = [self._reference(known, number) for number in range(len(self.reference_zooms()))]
        self._coarse = self._coarse_stage(topo_map)
        self._scale_by(known["wrong"], known["weights"], known["distances"])

    def observe(self, frame: Frame) -> Evidence:
        """A hypothesis for each node that is matched: where and how well the frame fits its panorama.

        Blind for a flat picture.
        """
        if not self._references:
            raise RuntimeError("IMA knows no map yet: call fit(topo_map) before observe(frame)")
        image = frame.images["rgb"]
        if scaled(grey(image), self.config.scale_columns, self._rows).std() < self.config.blind_deviation:
            return Evidence.blind()
        picture = self._filtered(image, self.config.clahe)
        nodes = self._candidates(picture)
        references = self._references if len(nodes) == len(self._positions) else self._chosen(nodes)
        return self._evidence(self._best_of_zooms(picture, references), nodes, frame.camera)

    def _candidates(self, picture: Image) -> Ints:
        """Indices of the nodes whose panoramas are matched, ascending: all, or those that the coarse stage picks."""
        if self._coarse is None:
            return np.arange(len(self._positions))
        return self._coarse.candidates(picture, self.config.candidates)

    def _chosen(self, nodes: Ints, kept_mb: float = 0.0) -> list[Reference]:
        """The panoramas of some nodes, by index."""
        return [ready.chosen(nodes, kept_mb) for ready in self._references]

    def prepare(self, panorama: Image) -> list[Reference]:
        """A panorama of the map made ready as ``fit`` does with every node's: plain, and zoomed in, each with K = 1."""
        circle = self._filtered_circle(panorama)
        return [self._made_reference(picture[None], circular=True) for picture in self._circles(circle)]

    def prepared(self, node: int) -> list[Reference]:
        """The same of the panorama that a node has now, by index; to be looked at only."""
        return self._chosen(np.array([node]))

    def replace_panorama(self, node: int, panorama: Image) -> None:
        """Give a node, by index, another panorama: as if ``fit`` had met it, but for the scale of the map.

        What wrong nodes give is not measured anew: one panorama changes it little, and to do so takes a second.

        Args:
            node: index into the nodes of the map.
            panorama: uint8 (rows, columns[, 3]), from the same heading on as the one before.
        """
        for ready, new in zip(self._references, self.prepare(panorama), strict=True):
            ready.put(node, new)
        if self._coarse is not None:
            self._coarse.put(node, self._filtered_circle(panorama))

    def find(self, image: Image, references: list[Reference]) -> Matches:
        """Where and how well a full-size frame matches panoramas that are ready; ``value`` as ``Evidence.match``."""
        found = self._best_of_zooms(self._filtered(image, self.config.clahe), references)
        return replace(found, value=self._likeness(found.value))

    def slots(self, image: Image, nodes: Sequence[int]) -> list[SlotMatches]:
        """Why a full-size frame matches panoramas as well as ``observe`` says: slot by slot (Code 2.1, 2.2).

        Args:
            image: uint8 (rows, columns[, 3]).
            nodes: indices into the nodes of the map, one for each result.
        """
        rows = np.asarray(nodes, dtype=np.int64)
        frames, references = self._zoomed(self._filtered(image, self.config.clahe), self._rows), self._chosen(rows)
        pairs = [(frame, references[0]) for frame in frames] + [(frames[0], wider) for wider in references[1:]]
        found = self._found(frames, references)
        zooms: list[int] = np.stack([matches.value for matches in found]).argmax(axis=0).tolist()
        return [self._slots_on(*pairs[zoom], found[zoom], row) for row, zoom in enumerate(zooms)]

    def _slots_on(self, frame: Pixels, reference: Reference, found: Matches, row: int) -> SlotMatches:
        """The slots of a prepared frame on one of several references."""
        columns, width = reference.columns, reference.slot_width
        place = found.column[row] + width * np.arange(self.config.slots)
        shift, value, counted = self._by_slot(frame, reference.chosen(np.array([row])), place % columns)
        left = np.mod(place + shift, columns) / columns
        return SlotMatches(left, width / columns, value, counted, float(self._likeness(found.value[row : row + 1])[0]))

    def _by_slot(self, frame: Pixels, reference: Reference, place: Ints) -> tuple[Ints, Floats, NDArray[np.bool_]]:
        """Of each slot (N_s,) at its place on one reference: columns that it gives way, value, whether it counts."""
        value = slot_values(frame, reference, self.config.slots, self.config.flat_variance)[0, place]
        winner = value.argmax(axis=1) == np.arange(self.config.slots)
        return np.zeros(len(place), dtype=np.int64), np.diagonal(value).astype(np.float64), winner

    def compare(self, image: Image, reference: Image) -> tuple[float, int]:
        """Match an image against a plain single image of the same camera, no circle (thesis 5.1.1, 5.1.5).

        Args:
            image: full-size grey or RGB.
            reference: the same.

        Returns:
            The match in [0, 1], best of the zooms, and the left edge of the view on the (zoomed) scaled reference.

        Raises:
            ValueError: they differ in aspect ratio.
        """
        if abs(image.shape[1] * reference.shape[0] - image.shape[0] * reference.shape[1]) > max(reference.shape):
            raise ValueError(
                f"an image of shape {image.shape} and a reference of {reference.shape} are no one camera's"
            )
        columns = self.config.scale_columns
        rows = max(1, round(columns * reference.shape[0] / reference.shape[1]))
        kept = self._filtered(reference, self.config.clahe)
        wider = [self._prepared(scaled(kept, columns, rows, 1.0, zoom)) for zoom in self.reference_zooms()]
        references = [self._made_reference(picture[None], circular=False) for picture in wider]
        best = self._best_of_zooms(self._filtered(image, self.config.clahe), references)
        return float(self._likeness(best.value)[0]), int(best.column[0])

    def reference_zooms(self) -> list[float]:
        """Zooms of the references: 1, and 1 / rho_out of (2.8), which stands for zooming the frame out."""
        return [1.0, *(1.0 + self._advances).tolist()]

    def _filtered(self, image: Image, filtering: bool, hfov_deg: float | None = None) -> Image:
        """Grey at full size, with CLAHE where asked for; ``hfov_deg`` is given for a full circle."""
        plain = grey(image)
        if not filtering:
            return plain
        return clahe(plain, self.config.clahe_clip_limit, self.config.clahe_tiles, hfov_deg)

    def _filtered_circle(self, panorama: Image) -> Image:
        """A panorama of the map, grey at full size, with CLAHE unless it has been through it."""
        return self._filtered(panorama, self._filtering, self._camera.hfov_deg)

    def _circle_of(self, node: Node) -> Image:
        """The same of a node, which has one."""
        panorama = node.panorama
        assert panorama is not None  # or ``fit`` would have refused the map
        return self._filtered_circle(panorama)

    def _circles(self, circle: Image) -> list[Pixels]:
        """A filtered full-size panorama as it is matched: plain, and zoomed in."""
        columns = self._camera.panorama_columns(self.config.scale_columns)
        zooms = self.reference_zooms()
        return [self._prepared(scaled(circle, columns, self._rows, 1.0, zoom), circular=True) for zoom in zooms]

    def _known_of(self, topo_map: TopoMap) -> Mapping[str, Pixels]:
        """What ``_prepared_map`` makes, or what the map's folder keeps of it.

        Of a class that names no store nothing is kept: it may prepare pictures in a way of its own.
        """
        if "store" not in vars(type(self)):
            return self._prepared_map(topo_map)
        settings = {name: value for name, value in asdict(self.config).items() if name not in ONLY_FOR_LOOKS}
        key = PREPARED, sorted(settings.items())
        return precomputed(topo_map, self.store, key, lambda: self._prepared_map(topo_map))

    def _coarse_stage(self, topo_map: TopoMap) -> CoarseStage | None:
        """None where all panoramas are to be matched, or where that takes no longer."""
        if not 0 < self.config.candidates * MATCHED_FOR_A_CANDIDATE <= len(topo_map.nodes):
            return None
        filtering = self._filtering, self.config.clahe_clip_limit, self.config.clahe_tiles
        return CoarseStage.fitted(topo_map, self.reference_zooms()[-1], self._circle_of, filtering)

    def _prepared_map(self, topo_map: TopoMap) -> dict[str, Pixels]:
        """Arrays of all panoramas, and what wrong nodes give; a panorama at a time is in memory at full size."""
        made: dict[str, Pixels] = {}
        for index, node in enumerate(topo_map.nodes):
            circle = self._circle_of(node)
            pictures = {f"pixels_{number}": picture for number, picture in enumerate(self._circles(circle))}
            for name, picture in pictures.items():
                if index == 0:
                    made[name] = np.empty((len(topo_map.nodes), *picture.shape), picture.dtype)
                made[name][index] = picture
        self._references = []
        for number in range(len(self.reference_zooms())):
            reference = self._made_reference(made[f"pixels_{number}"], circular=True)
            made[f"scales_{number}"] = reference.scales
            self._references.append(reference)
        wrong = self._values_of_wrong_nodes(topo_map)
        return made | dict(zip(("wrong", "weights", "distances"), wrong, strict=True))

    def _reference(self, known: Mapping[str, Pixels], number: int) -> Reference:
        """The panoramas at one zoom, of what ``_prepared_map`` made."""
        width, memory_mb = self.config.scale_columns // self.config.slots, self._memory_mb
        return Reference(known[f"pixels_{number}"], known[f"scales_{number}"], width, True, memory_mb)

    def _made_reference(self, pictures: Pixels, circular: bool) -> Reference:
        slot_width = self.config.scale_columns // self.config.slots
        return make_reference(pictures, slot_width, self.config.flat_variance, circular, self._memory_mb)

    @property
    def _memory_mb(self) -> float:
        """For the transforms of panoramas at one zoom [MB]."""
        return self.config.memory_mb / len(self.reference_zooms())

    def _prepared(self, picture: Image, circular: bool = False) -> Pixels:
        """What of a scaled picture (rows, columns) is matched: the published IMA takes its grey levels as they are."""
        del circular
        return picture

    @property
    def _sums(self) -> Sums:
        """How slots add up to a match."""
        return sums_of_winners

    def _likeness(self, value: Floats) -> Floats:
        """``Evidence.match`` of what ``_found`` found: the published IMA's is that value itself."""
        return value

    def _best_of_zooms(self, picture: Image, references: list[Reference]) -> Matches:
        """The best of the combinations of 4.1.5 for each reference, ``picture`` at full size and filtered."""
        nearer = self._advances
        advances = np.concatenate([[0.0], -nearer, nearer])
        return best_of(self._found(self._zoomed(picture, references[0].pixels.shape[1]), references), advances)

    def _zoomed(self, picture: Image, rows: int) -> list[Pixels]:
        """A frame as it is matched, so many rows high: plain, and zoomed in (4.1.5)."""
        zooms = [1.0, *(1.0 / (1.0 - self._advances)).tolist()]
        return [self._prepared(scaled(picture, self.config.scale_columns, rows, zoom, zoom)) for zoom in zooms]

    def _found(self, frames: list[Pixels], references: list[Reference]) -> list[Matches]:
        """Every frame on the plain references, then the plain frame on every wider one."""
        slots, flat_variance = self.config.slots, self.config.flat_variance
        found = match_frames(frames, references[0], slots, flat_variance, self._sums)
        for wider in references[1:]:
            found += match_frames(frames[:1], wider, slots, flat_variance, self._sums)
        return found

    def _evidence(self, matches: Matches, nodes: Ints, mount: Floats) -> Evidence:
        """Heading by (2.2), of the window's middle on the circle that was searched, counter-clockwise.

        The panoramas were taken by a robot that turned on its axis (5.1.2), so the node is where that axis stood; the
        zoom that matches best tells how far ahead of it the robot is now.
        """
        middle = matches.column + self.config.scale_columns / 2.0
        heading = wrap(self._headings[nodes] - middle * 2.0 * np.pi / matches.columns)
        ahead = self.config.scene_m * matches.advance
        positions = self._positions[nodes] + ahead[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        match = self._likeness(matches.value)
        count = len(match)
        log_density = np.log(self._density[nodes])
        sureness = match - self.base_match - self.config.sure_margin
        return Evidence(
            poses=camera_on_nodes(positions, heading, mount),
            nodes=nodes,
            match=match,
            distance=1.0 - match,
            log_likelihoods=self.config.slope * (match - self.base_match - self.config.margin) - log_density,
            sigma=np.full(count, self.config.sigma_m),
            kappa=self.config.kappa * np.exp(self.config.kappa_fall * np.minimum(sureness, 0.0)),
            log_floor=self.config.log_floor,
        )

    def _scale_by(self, wrong: Floats, weights: Floats, distances: Floats) -> None:
        """Take the scale of the map from what wrong nodes give: values, weights and distances away [m], (N,) each."""
        del distances  # the published IMA matches on a node, so that any other node is wrong
        self.base_match = (
            float(np.average(self._likeness(wrong), weights=weights)) if len(wrong) else self.unrelated_match
        )

    def _values_of_wrong_nodes(self, topo_map: TopoMap) -> tuple[Floats, Floats, Floats]:
        """What ``_scale_by`` takes, of views cut from each node's panorama on all others; few views of many nodes."""
        held = _evenly(len(topo_map.nodes), CALIBRATION_OTHERS)
        references = self._chosen(held, self._memory_mb)
        values, weights, distances = [], [], []
        for own in _evenly(len(topo_map.nodes), CALIBRATION_NODES).tolist():
            away = np.linalg.norm(self._positions[held] - self._positions[own], axis=1)
            others = away > SAME_PLACE_M
            circle = self._circle_of(topo_map.nodes[own])
            for window, _ in cut_views(circle, 0.0, self._camera)[::CALIBRATION_STRIDE]:
                values.append(self._best_of_zooms(window, references).value[others])
                weights.append(1.0 / (self._density[own] * self._density[held][others]))
                distances.append(away[others])
        return np.concatenate(values), np.concatenate(weights), np.concatenate(distances)


def _evenly(count: int, most: int) -> Ints:
    """Numbers below ``count``, at most so many, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
