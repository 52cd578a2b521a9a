"""Looks taken together say what they say one by one; what was learnt of a map is kept beside it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sensors import ColorHistogram, Descriptor, FourierSignature, PCAMap
from sensors.descriptor import DescriptorConfig
from sensors.histogram import ColorHistogramConfig
from sensors.images import views_of
from topoloc.pictures import PictureFile
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image

CAMERA = Camera(45.0, 32, 24)


def picture(seed: int, columns: int) -> Image:
    tiles = np.random.default_rng(seed).integers(0, 256, (6, columns // 8, 3)).astype(np.uint8)
    return tiles.repeat(4, axis=0).repeat(8, axis=1)


def frame_of(seed: int) -> Frame:
    image = picture(seed, 32) if seed % 4 else np.full((24, 32, 3), 90, np.uint8)  # every fourth is blind
    return Frame(float(seed), None, np.zeros(3), {"rgb": image, "omni": picture(seed + 500, 256)})


def map_of(kind: str) -> TopoMap:
    places = [(float(k % 4), float(k // 4)) for k in range(12)]
    if kind == "views":
        nodes = tuple(Node(f"n{k}", f"n{k}", x, y) for k, (x, y) in enumerate(places))
        views = tuple(
            View(np.array([x, y, turn - 2.0]), picture(100 + 4 * k + turn, 32))
            for k, (x, y) in enumerate(places)
            for turn in range(4)
        )
        return TopoMap("views", CAMERA, nodes, views=views)
    circles = (Node(f"n{k}", f"n{k}", x, y, 0.1 * k, picture(k, 256)) for k, (x, y) in enumerate(places))
    return TopoMap("circles", CAMERA, tuple(circles))


SENSORS: dict[str, Callable[[], Any]] = {
    "pca": PCAMap,
    "histogram": ColorHistogram,
    "votes": lambda: ColorHistogram(ColorHistogramConfig(voting="unanimous", least_confidence=0.0)),
    "cosine": Descriptor,
    "euclidean": lambda: Descriptor(DescriptorConfig(distance="euclidean")),
    "fourier": FourierSignature,
}


def assert_same(ones: list[Evidence], others: list[Evidence]) -> None:
    for one, other in zip(ones, others, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)
        for name in ("poses", "match", "distance", "log_likelihoods", "sigma", "kappa"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", ["views", "circles"])
@pytest.mark.parametrize("name", SENSORS)
def test_many_looks_are_so_many_single_ones(name: str, kind: str) -> None:
    if (name, kind) == ("fourier", "views"):
        pytest.skip("compares panoramas")
    sensor = SENSORS[name]()
    sensor.fit(map_of(kind))
    frames = [frame_of(seed) for seed in range(9)]
    together = sensor.observe_many(frames)
    assert_same(together, [sensor.observe(frame) for frame in frames])
    assert sensor.observe_many([]) == []
    if name in ("pca", "histogram", "cosine"):
        assert [one.is_blind for one in together] == [seed % 4 == 0 for seed in range(9)]
        assert all(one.is_blind for one in sensor.observe_many(frames[::4]))


def refuse(self: PictureFile) -> Image:
    raise AssertionError(f"{self.path} was read")


@pytest.mark.parametrize("kind", ["views", "circles"])
@pytest.mark.parametrize("name", ["pca", "histogram", "cosine", "fourier"])
def test_a_map_that_is_opened_again_reads_no_picture(
    name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if (name, kind) == ("fourier", "views"):
        pytest.skip("compares panoramas")
    map_of(kind).save(tmp_path / "map")
    frames = [frame_of(seed) for seed in range(1, 4)]
    first, again = SENSORS[name](), SENSORS[name]()
    first.fit(TopoMap.load(tmp_path / "map"))
    with monkeypatch.context() as patched:
        patched.setattr(PictureFile, "read", refuse)
        again.fit(TopoMap.load(tmp_path / "map"))
        assert_same(first.observe_many(frames), again.observe_many(frames))
    if name == "pca":
        np.testing.assert_array_equal(first.basis.components_, again.basis.components_)
        if kind == "views":
            again.extend([View(np.zeros(3), picture(999, 32))])


class Darker(ColorHistogram):
    """Somebody else's, who describes in another way."""

    def describe(self, pictures: Any) -> Any:
        return super().describe({"rgb": pictures["rgb"] // 2})


def test_what_describes_in_another_way_does_not_find_what_was_kept(tmp_path: Path) -> None:
    map_of("views").save(tmp_path / "map")
    topo_map = TopoMap.load(tmp_path / "map")
    plain, darker = ColorHistogram(), Darker()
    plain.fit(topo_map)
    darker.fit(topo_map)
    assert darker.observe(Frame(0.0, None, np.zeros(3), {"rgb": map_of("views").views[5].image})).match[0] > 0.99
    function = Descriptor(function=lambda image: image[::4, ::8, 0])
    Descriptor().fit(topo_map)
    function.fit(topo_map)
    assert function._descriptors.shape == (48, 24)


@pytest.mark.parametrize("kind", ["views", "circles"])
def test_pictures_of_views_come_from_the_disk_one_by_one(kind: str, tmp_path: Path, monkeypatch: Any) -> None:
    plain = map_of(kind)
    plain.save(tmp_path / "map")
    with monkeypatch.context() as patched:
        patched.setattr(PictureFile, "read", refuse)
        views = views_of(TopoMap.load(tmp_path / "map"))
    known = views_of(plain)
    np.testing.assert_allclose(views.poses, known.poses, atol=1e-9)
    assert len(views.images) == len(known.images) == (48 if kind == "views" else 12 * 24)
    for one, other in zip(views.images, known.images, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(views.images[-1], known.images[len(known.images) - 1])
    with pytest.raises(IndexError):
        views.images[len(views.images)]
