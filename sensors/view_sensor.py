"""What sensors have in common that make one descriptor of a picture and compare it with those of a map's views."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from sensors.images import Views, deviation, views_of
from sensors.lazy import Lazy
from sensors.nearest import Plain, Search
from sensors.neighbourhood import BASE_MATCH, NeighbourConfig, Neighbourhood
from topoloc.array_folder import Arrays
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.map_store import precomputed
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, Ints, Pixels

Pictures = Mapping[str, Pixels]
"""By kind, as in ``Frame.images``."""


@dataclass(frozen=True)
class ViewConfig(NeighbourConfig):
    """Settings of sensors that make one descriptor of a picture.

    Attributes:
        blind_deviation: a picture whose grey levels deviate less says nothing: a covered lens [grey levels].
    """

    blind_deviation: float = 6.0


class ViewSensor(ABC):
    """A frame's descriptor, the nearest of the map's views by a distance, and their poses as hypotheses.

    Subclasses say what a descriptor is and how far two are apart.
    """

    Config: ClassVar[type[ViewConfig]] = ViewConfig
    needs: frozenset[str] = frozenset({"rgb"})
    base_match: ClassVar[float] = BASE_MATCH
    name: ClassVar[str]
    """As people know it from ``topoloc list sensors``, for messages."""

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config
        self._topo_map: TopoMap | None = None
        self._views: Views | None = None

    @abstractmethod
    def describe(self, pictures: Pictures) -> Floats:
        """Descriptor (...) of a frame's pictures; raises ``RuntimeError`` where the sensor first has to know a map."""

    @abstractmethod
    def distances(self, queries: Floats, others: Floats) -> Floats:
        """Distances (Q, V) between descriptors (Q, ...) and (V, ...)."""

    def fit(self, topo_map: TopoMap) -> None:
        """Descriptors of the map's views, or of views cut from its panoramas, and the scale of their distances.

        Raises:
            UserError: the map has not what is needed.
        """
        views = self._views_of(topo_map)
        pictures = Lazy(len(views.images), partial(self._pictures, views))

        def learn() -> Arrays:
            return {"descriptors": self._learn(pictures), **self._state()}

        own = self._key() if "_key" in vars(type(self)) else None  # a subclass may describe in another way
        self._restore(learn() if own is None else precomputed(topo_map, self.name, own, learn))
        self._settle(topo_map, views)

    def observe(self, frame: Frame) -> Evidence:
        """The nearest views as hypotheses; blind for a picture without contrast."""
        return self.observe_many([frame])[0]

    def observe_many(self, frames: Sequence[Frame]) -> list[Evidence]:
        """What ``observe`` says of each frame, but for rounding; comparing all with the views at once is faster."""
        if self._views is None:
            raise RuntimeError(f"{type(self).__name__} knows no map yet: call fit(topo_map) before observe(frame)")
        seen = self._seen_many([frame.images for frame in frames])
        readable = [descriptor for descriptor in seen if descriptor is not None]
        if not readable:
            return [Evidence.blind() for _ in frames]
        found = zip(*self._search.nearest(np.stack(readable), self._neighbourhood.count), strict=True)
        return [
            Evidence.blind() if descriptor is None else self._evidence(*next(found), frame)
            for frame, descriptor in zip(frames, seen, strict=True)
        ]

    def distances_between(self, images: Sequence[Image]) -> Floats:
        """Distances (N, N) of pictures among each other, without a map."""
        own = self._learn([dict.fromkeys(self.needs, image) for image in images])
        return self.distances(own, own)

    def _settle(self, topo_map: TopoMap, views: Views) -> None:
        """Take views whose descriptors are known as those to compare with."""
        self._topo_map, self._views = topo_map, views
        self._neighbourhood = Neighbourhood(
            topo_map, views.poses, self._between, self.config, held_out_works=not views.on_nodes
        )
        self._search = self._search_of(self._descriptors)

    def _search_of(self, descriptors: Any) -> Search:
        """How the nearest of the views' descriptors are found."""
        return Plain(self.distances, descriptors)

    def _evidence(self, chosen: Ints, distance: Floats, frame: Frame) -> Evidence:
        """Of the nearest views (J,), at distances (J,), for a frame."""
        assert self._views is not None
        return self._neighbourhood.evidence(chosen, distance, self._views.camera_poses(chosen, frame.camera))

    def _views_of(self, topo_map: TopoMap) -> Views:
        """What the sensor trains on."""
        views = views_of(topo_map)
        if not views.images:
            raise UserError(f"map {topo_map.name!r}: {self.name} needs training views or panoramas; add either")
        return views

    def _key(self) -> object:
        """What the descriptors depend on besides the map, told by its ``repr``: so they are kept beside the map.

        None, for who does not say: then they are made at each start.
        """
        return None

    def _state(self) -> Arrays:
        """What else ``_learn`` found out, by name."""
        return {}

    def _restore(self, known: Arrays) -> None:
        """Take the descriptors and what ``_state`` gave, now or in another process."""
        self._descriptors: Any = known["descriptors"]

    def _pictures(self, views: Views, index: int) -> Pictures:
        """The pictures of one view."""
        return {"rgb": views.images[index]}

    def _learn(self, views: Sequence[Pictures]) -> Floats:
        """Descriptors (V, ...) of the views; a sensor that must know all before it describes one learns them here."""
        return np.stack([self.describe(pictures) for pictures in views])

    def _seen_many(self, looks: Sequence[Pictures]) -> list[Floats | None]:
        """``_seen`` of each frame's pictures; a sensor that describes many at once does it here."""
        return [self._seen(pictures) for pictures in looks]

    def _seen(self, pictures: Pictures) -> Floats | None:
        """Descriptor of a frame's pictures; None where they say nothing."""
        return None if self._is_blind(pictures) else self.describe(pictures)

    def _is_blind(self, pictures: Pictures) -> bool:
        return bool(deviation(pictures["rgb"]) < self.config.blind_deviation)

    def _between(self, rows: Ints) -> Floats:
        return self.distances(self._descriptors[rows], self._descriptors)
