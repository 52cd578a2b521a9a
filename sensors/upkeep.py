"""Panoramas kept up to date from frames taken where the localizer is sure (thesis 5.2.3, 6.2; the method is ours)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.ima import IMA
from sensors.images import clahe, crop_centre, grey, resize
from sensors.slot_correlation import Reference
from sensors.slot_matching import Matches
from topoloc.errors import UserError
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Frame, Image, Ints, Status

NOT_SEEN = -1
"""Instead of the visit that a slot's candidate was seen in: there is no candidate."""
FADING_ROWS = 8
"""Where a picture is lower than the panorama, its upper and lower edges fade over so many rows."""


@dataclass(frozen=True)
class UpkeepConfig:
    """When a frame is trusted, and when a slot is refreshed; chosen on seeds 1000 to 1003 of the simulated laboratory.

    Attributes:
        probability: least probability of the estimate.
        position_sd_m: largest standard deviation of its position, root mean square of both axes [m].
        reach_m: farthest that the estimate may lie from its node [m].
        match: least match of the frame at that node.
        lead: least margin of that match over the match at every other node: between two nodes a frame belongs to none.
        heading_deg: most that the heading matched there may differ from the estimate's [degrees].
        look_back: frames kept, with their pictures, until the localizer is sure again; 0 never looks back.
        gap_m: most that the odometry on from the last sure pose may differ there from that back from the next: both
            poses may be a node's, that the robot passed beside [m].
        gap_deg: the same of its heading [degrees].
        slot_alike: NCC in [0, 1], as in (A.4), from which on two visits show the same in a slot.
        slot_gain: by how much more alike they must be than the second of them is to the panorama.
        slack_columns: how far the two may be shifted against each other, columns of the scaled panorama: what is near
            shifts against what is far from pass to pass.
        visit_updates: updates without a frame that was trusted at a node, after which the next one is another visit.
        feather_slots: how wide the edges of what is pasted fade out, inside the frame, in slots.
        restore_looks: frames over which the panorama before is held against the refreshed one.
        restore_margin: mean match by which it must be better to come back.
    """

    probability: float = 0.8
    position_sd_m: float = 0.7
    reach_m: float = 0.5
    match: float = 0.5
    lead: float = 0.05
    heading_deg: float = 10.0
    look_back: int = 12
    gap_m: float = 1.0
    gap_deg: float = 15.0
    slot_alike: float = 0.75
    slot_gain: float = 0.05
    slack_columns: int = 1
    visit_updates: int = 10
    feather_slots: float = 0.25
    restore_looks: int = 6
    restore_margin: float = 0.02

    def __post_init__(self) -> None:
        for name in ("probability", "match", "lead", "slot_alike", "slot_gain"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and 1")
        for name in ("position_sd_m", "reach_m", "heading_deg", "gap_m", "gap_deg"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        if not 0.0 <= self.feather_slots <= 0.5:
            raise ValueError(f"feather_slots is {self.feather_slots}; it must lie between 0 and 0.5")
        if min(self.visit_updates, self.restore_looks) < 1:
            raise ValueError("visit_updates and restore_looks must be at least 1")
        if min(self.look_back, self.slack_columns, self.restore_margin) < 0:
            raise ValueError("look_back, slack_columns and restore_margin must not be negative")


@dataclass(frozen=True)
class Change:
    """A change of a node's panorama.

    Attributes:
        timestamp: of the frame that led to it [s].
        node: index into ``topo_map.nodes``.
        slots: (S,) numbers of the panorama's slots that were pasted, clockwise from its first column; none where the
            panorama before came back.
        middles: (S,) where the middle of each lies on the frame: 0 its left edge, 1 its right edge.
    """

    timestamp: float
    node: int
    slots: Ints
    middles: Floats

    @property
    def restored(self) -> bool:
        """Whether the panorama before came back."""
        return len(self.slots) == 0


@dataclass
class _Kept:
    """What is known of one node.

    Attributes:
        before: the map's own panorama, full size: never changed.
        now: as refreshed; the same object until then.
        candidates: (rows, C) scaled pixels of what each slot showed when it was last seen.
        seen_in: (S,) visit in which each slot's candidate was seen, or ``NOT_SEEN``.
        refreshed: (S,) which slots were pasted.
        visit, last: number of the visit, and of the update in which a frame was last trusted here.
        gains: of the last looks: match of the panorama before, less that of the refreshed one.
        ready: the panorama before, made ready; None until something is pasted.
    """

    before: Image
    now: Image
    candidates: Floats
    seen_in: Ints
    refreshed: NDArray[np.bool_]
    gains: deque[float]
    visit: int = 0
    last: int = 0
    ready: list[Reference] | None = None


@dataclass(frozen=True)
class View:
    """A frame brought to a node's place, and where it lies on the node's panorama.

    Attributes:
        picture: at the panorama's scale, as seen from the node: (rows, columns[, 3]), no higher than the panorama.
        left: column of the full-size panorama that its left edge lies on.
        share: of the frame's columns that it shows, about the middle.
    """

    picture: Image
    left: int
    share: float = 1.0


class PanoramaUpkeep:
    """Refreshes panoramas, slot by slot, from frames taken when the localizer is sure.

    A frame is used only where every sign agrees (``UpkeepConfig``). It is laid on its node's panorama where it matches
    best, scaled by the zoom that matches best: by (2.5) that tells how far ahead of the node the camera stood, better
    than an estimate that the tracker puts on the node itself. The circle is divided into slots as wide as IMA's: on the
    circle, not on the frame, so that two frames show the same slots. What a frame shows in a slot is remembered, and
    pasted only when another visit to the node shows the same, more alike than the panorama is: somebody who stood
    there once is never burnt in. The map's own panorama is kept, held against the refreshed one at every later look,
    and comes back by itself where it matches better, or by ``restore``.

    Were only those frames used that match already, the nodes that have changed most would never be refreshed, and lose
    against neighbours that match better and better. So frames are kept until the localizer is sure again. Where the
    odometry on from the last sure pose and back from the next one agree on where a frame was taken, and the heading
    that it matches the node there with agrees with them, it is sure in hindsight.

    Args:
        topo_map: as the localizer has it.
        sensor: the localizer's: its panoramas are exchanged as they are refreshed.
        config: when to trust and when to paste.

    Raises:
        UserError: the sensor is no kind of IMA.
    """

    Config: ClassVar[type[UpkeepConfig]] = UpkeepConfig

    def __init__(self, topo_map: TopoMap, sensor: Any, config: UpkeepConfig | None = None) -> None:
        if not isinstance(sensor, IMA):
            raise UserError(
                f"the upkeep of panoramas cannot serve {type(sensor).__name__}; take the sensor ima or ima-robust"
            )
        self.config = config or UpkeepConfig()
        self.log: list[Change] = []
        self._map, self._sensor = topo_map, sensor
        self._nodes: dict[int, _Kept] = {}
        self._updates = 0
        self._last_sure: tuple[Floats, Floats] | None = None  # raw odometer and estimated pose, (3,) each
        self._doubtful: deque[tuple[int, Frame]] = deque(maxlen=self.config.look_back)  # since then, by update
        columns = topo_map.camera.panorama_columns(sensor.config.scale_columns)
        count = round(columns / (sensor.config.scale_columns // sensor.config.slots))
        self._edges = np.rint(np.linspace(0, columns, count + 1)).astype(np.int64)  # of the slots, scaled columns

    @property
    def topo_map(self) -> TopoMap:
        """The map as refreshed."""
        nodes = [
            replace(node, panorama=self._nodes[index].now) if index in self._nodes else node
            for index, node in enumerate(self._map.nodes)
        ]
        return replace(self._map, nodes=tuple(nodes))

    @property
    def before(self) -> dict[int, Image]:
        """The map's own panorama of each node, by index, whose panorama is another now."""
        return {index: kept.before for index, kept in self._nodes.items() if kept.refreshed.any()}

    def after(self, frame: Frame, estimate: Estimate, evidence: Evidence) -> None:
        """Look at an update, after it was made: see ``topoloc.interfaces.Upkeep``."""
        self._updates += 1
        node = estimate.node
        if node is not None and estimate.status is not Status.LOST and self._in_reach(estimate.pose, node):
            if node in self._nodes and self._nodes[node].refreshed.any():
                self._doubt(frame, estimate, node)
            if self._is_sure(estimate, evidence, node):
                self._look_back(frame, estimate.pose)
                self._refresh(frame, node, self._updates)
                self._last_sure = None if frame.odometry is None else (frame.odometry, estimate.pose)
                self._doubtful.clear()
                return
        if frame.odometry is not None and self._last_sure is not None:
            self._doubtful.append((self._updates, frame))

    def restore(self, node: int, timestamp: float = 0.0) -> None:
        """Give a node, by index, the map's own panorama back; what was remembered of it is forgotten."""
        if node in self._nodes:
            kept = self._nodes.pop(node)
            self._sensor.replace_panorama(node, kept.before)
            self.log.append(Change(timestamp, node, np.zeros(0, dtype=np.int64), np.zeros(0)))

    def _in_reach(self, pose: Floats, node: int) -> bool:
        return bool(np.linalg.norm(pose[:2] - self._map.positions[node]) <= self.config.reach_m)

    def _look_back(self, frame: Frame, pose: Floats) -> None:
        """Refresh from the frames since the last sure one that this frame, taken at a sure pose, makes sure as well."""
        if frame.odometry is None or self._last_sure is None:
            return
        for taken, doubtful in self._doubtful:
            assert doubtful.odometry is not None  # or it would not have been kept
            on = compose(self._last_sure[1], between(self._last_sure[0], doubtful.odometry))
            back = compose(pose, between(frame.odometry, doubtful.odometry))
            turned = float(wrap(back[2] - on[2]))
            apart = float(np.linalg.norm(back[:2] - on[:2]))
            if apart > self.config.gap_m or abs(turned) > np.deg2rad(self.config.gap_deg):
                continue
            reckoned = np.array([*(on[:2] + back[:2]) / 2.0, on[2] + turned / 2.0])
            node = int(self._map.nearest_node(reckoned[None, :2])[0])
            if not self._in_reach(reckoned, node):
                continue
            if self._faces(doubtful, reckoned, node, self._found(doubtful, node)[-1]):
                self._refresh(doubtful, node, taken)

    def _faces(self, frame: Frame, pose: Floats, node: int, found: Matches) -> bool:
        """Whether the heading that a frame matches a node with is that of a robot at this pose."""
        heading = self._map.nodes[node].heading - 2.0 * np.pi * self._middle(found)
        return bool(abs(float(wrap(heading - pose[2] - frame.camera[2]))) <= np.deg2rad(self.config.heading_deg))

    def _is_sure(self, estimate: Estimate, evidence: Evidence, node: int) -> bool:
        """Whether localizer and picture agree on where the frame was taken; the node is in reach already."""
        config, here = self.config, np.flatnonzero(evidence.nodes == node)
        if not len(here) or estimate.status is not Status.LOCALIZED or estimate.probability < config.probability:
            return False
        if np.sqrt(np.trace(estimate.covariance[:2, :2]) / 2.0) > config.position_sd_m:
            return False
        best = here[evidence.match[here].argmax()]
        others = evidence.match[evidence.nodes != node]
        if evidence.match[best] < max(config.match, others.max(initial=0.0) + config.lead):
            return False
        turned = float(wrap(evidence.poses[best, 2] - estimate.pose[2]))
        return bool(abs(turned) <= np.deg2rad(self.config.heading_deg))

    def _refresh(self, frame: Frame, node: int, taken: int) -> None:
        """Take in a frame that can be trusted: remember what is new on it, paste what is new for the second time.

        Args:
            frame: it.
            node: that it shows.
            taken: number of its update, which for one that is looked back at lies in the past.
        """
        kept = self._kept(node)
        kept.visit += kept.last + self.config.visit_updates <= taken
        kept.last = taken
        view = self._laid(frame.images["rgb"], kept.now, self._found(frame, node)[-1])
        covered, middles = self._covered(view, kept.now.shape[1])
        seen = self._sensor.prepare(pasted(kept.now, view, np.ones(kept.now.shape[1])))[0].pixels[0].astype(np.float64)
        rows = middle_rows(len(seen), len(view.picture) / len(kept.now))
        held = self._ncc(seen[rows], self._sensor.prepared(node)[0].pixels[0, rows].astype(np.float64))
        earlier = (kept.seen_in != NOT_SEEN) & (kept.seen_in < kept.visit)
        again = np.where(earlier, self._ncc(seen[rows], kept.candidates[rows]), 0.0)
        confirmed = covered & (again >= np.maximum(self.config.slot_alike, held + self.config.slot_gain))
        kept.seen_in[covered] = kept.visit
        kept.seen_in[confirmed] = NOT_SEEN
        kept.candidates = np.where(np.repeat(covered, np.diff(self._edges)), seen, kept.candidates)
        if confirmed.any():
            self.paste(node, view, confirmed)
            self.log.append(Change(frame.timestamp, node, np.flatnonzero(confirmed), middles[confirmed]))

    def paste(self, node: int, view: View, slots: NDArray[np.bool_]) -> None:
        """Put slots (S,) of a view on the panorama of a node, by index; their edges fade out."""
        kept = self._kept(node)
        columns = kept.now.shape[1]
        kept.ready = kept.ready or self._sensor.prepare(kept.before)
        chosen = np.repeat(slots, np.diff(self._full_edges(columns))).astype(np.float64)
        kept.now = pasted(kept.now, view, softened(chosen, self._feather(columns)))
        kept.refreshed |= slots
        self._sensor.replace_panorama(node, kept.now)

    def _doubt(self, frame: Frame, estimate: Estimate, node: int) -> None:
        """Hold the panorama before against the refreshed one; after enough looks the better one stays.

        Asked for less than sureness: a refresh that went wrong makes the localizer unsure at this very node. A frame
        that matches the panorama before, with the estimated heading, is reason enough to look.
        """
        kept, image = self._nodes[node], frame.images["rgb"]
        before, now = self._found(frame, node)[:2]
        if before.value[0] < self.config.match or not self._faces(frame, estimate.pose, node, before):
            return
        covered, _ = self._covered(self._laid(image, kept.now, before), kept.now.shape[1])
        if not (covered & kept.refreshed).any():
            return
        kept.gains.append(float(before.value[0] - now.value[0]))
        if len(kept.gains) == self.config.restore_looks and np.mean(kept.gains) > self.config.restore_margin:
            self.restore(node, frame.timestamp)

    def _kept(self, node: int) -> _Kept:
        if node in self._nodes:
            return self._nodes[node]
        panorama, slots = self._map.nodes[node].panorama, len(self._edges) - 1
        assert panorama is not None  # or the sensor would have refused the map
        rows = self._sensor.prepared(node)[0].pixels.shape[1]
        self._nodes[node] = _Kept(
            panorama,
            panorama,
            candidates=np.zeros((rows, int(self._edges[-1]))),
            seen_in=np.full(slots, NOT_SEEN),
            refreshed=np.zeros(slots, dtype=bool),
            gains=deque(maxlen=self.config.restore_looks),
        )
        return self._nodes[node]

    def _found(self, frame: Frame, node: int) -> list[Matches]:
        """Where a frame matches the panorama before, if it is another, and that of now; last the better of them."""
        kept, image = self._kept(node), frame.images["rgb"]
        found = [self._sensor.find(image, self._sensor.prepared(node))]
        if kept.ready is not None:
            found.insert(0, self._sensor.find(image, kept.ready))
        return [*found, max(found, key=lambda matches: float(matches.value[0]))]

    def _middle(self, found: Matches) -> float:
        """Where the middle of a frame lies on the circle, as a share of it, clockwise from the first column."""
        return float((found.column[0] + self._sensor.config.scale_columns / 2.0) / found.columns[0])

    def _laid(self, image: Image, panorama: Image, found: Matches) -> View:
        """A frame as seen from the node: enlarged where the camera stood behind it, shrunk where ahead, by (2.5)."""
        scale = 1.0 / (1.0 + float(found.advance[0]))
        rows, columns = panorama.shape[:2]
        width = round(columns * self._map.camera.hfov_deg / 360.0)
        share = min(1.0, 1.0 / scale)
        kept = crop_centre(self._as_panorama(image, panorama), share, share)
        picture = resize(kept, round(width * min(1.0, scale)), round(rows * min(1.0, scale)))
        return View(picture, round(self._middle(found) * columns - picture.shape[1] / 2.0), share)

    def _as_panorama(self, image: Image, panorama: Image) -> Image:
        """A frame in the colours of the panorama: filtered as its snapshots were, grey or RGB."""
        config = self._sensor.config
        if self._map.filtered:
            image = clahe(grey(image), config.clahe_clip_limit, config.clahe_tiles)
        if panorama.ndim == 2:
            return grey(image)
        return image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)

    def _full_edges(self, columns: int) -> Ints:
        """(S + 1,) edges of the slots on a full-size panorama."""
        return np.asarray(np.rint(self._edges * (columns / self._edges[-1])), dtype=np.int64)

    def _feather(self, columns: int) -> int:
        """How far the edges fade to either side, columns of a full-size panorama."""
        return round(self.config.feather_slots * columns / (len(self._edges) - 1))

    def _covered(self, view: View, columns: int) -> tuple[NDArray[np.bool_], Floats]:
        """Which slots (S,) lie on a view with their faded edges, and where their middles lie on it: see ``Change``."""
        edges, fade, width = self._full_edges(columns), self._feather(columns), view.picture.shape[1]
        slot = np.diff(edges)
        start = (edges[:-1] - fade - view.left) % columns
        aside = (start + fade + slot / 2.0) / width - 0.5
        return start + slot + 2 * fade <= width, 0.5 + aside * view.share

    def _ncc(self, one: Floats, other: Floats) -> Floats:
        """How alike the slots (S,) of two scaled panoramas (rows, C) are."""
        return slot_ncc(one, other, self._edges, self.config.slack_columns, self._sensor.config.flat_variance)


def slot_ncc(one: Floats, other: Floats, edges: Ints, slack: int, flat_variance: float) -> Floats:
    """c* of (A.4), in [0, 1], of each slot (S,) of two circles (rows, C), the best of some shifts of the other.

    Args:
        one: (rows, C).
        other: (rows, C).
        edges: (S + 1,) of the slots, columns, from 0 to C.
        slack: largest shift, columns.
        flat_variance: a slot that varies less has no correlation: 0.5 [grey level^2].
    """
    pixels = one.shape[0] * np.diff(edges)

    def per_slot(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values.sum(axis=0), edges[:-1]))

    def correlation(moved: Floats) -> Floats:
        first, second = per_slot(one), per_slot(moved)
        energies = [per_slot(image**2) - total**2 / pixels for image, total in ((one, first), (moved, second))]
        flat = np.minimum(*energies) < flat_variance * pixels
        product = np.where(flat, 1.0, energies[0] * energies[1])
        return np.where(flat, 0.0, (per_slot(one * moved) - first * second / pixels) / np.sqrt(product))

    shifts = range(-slack, slack + 1)
    return np.asarray((np.max([correlation(np.roll(other, shift, axis=1)) for shift in shifts], axis=0) + 1.0) / 2.0)


def middle_rows(rows: int, share: float) -> slice:
    """The whole rows among ``rows`` that lie within this share of the height, about the middle."""
    outside = int(np.ceil(rows * (1.0 - share) / 2.0))
    return slice(outside, rows - outside)


def softened(weights: Floats, reach: int) -> Floats:
    """Weights (C,) around a circle whose steps become slopes that reach so many columns to either side."""
    around = np.arange(-reach, len(weights) + reach) % len(weights)
    return np.asarray(np.convolve(weights[around], np.full(2 * reach + 1, 1.0 / (2 * reach + 1)), mode="valid"))


def pasted(panorama: Image, view: View, weights: Floats) -> Image:
    """A copy of a panorama that a view covers in part: its middle rows, in these weights (columns of the panorama,)."""
    rows, columns = panorama.shape[:2]
    height, width = view.picture.shape[:2]
    top, at = (rows - height) // 2, (view.left + np.arange(width)) % columns
    fade = np.minimum(1.0, (np.minimum(np.arange(height), np.arange(height)[::-1]) + 0.5) / FADING_ROWS)
    share = np.outer(fade if height < rows else np.ones(height), weights[at])
    share = share.reshape(height, width, *(1,) * (panorama.ndim - 2))
    result = panorama.copy()
    there = panorama[top : top + height, at].astype(np.float64)
    result[top : top + height, at] = np.rint(there + share * (view.picture - there)).astype(np.uint8)
    return result
