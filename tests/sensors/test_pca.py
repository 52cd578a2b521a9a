"""The appearance map of principal components."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from sensors.images import PREPROCESSING, equalised, gradient
from sensors.pca import PCAMap, PCAMapConfig
from topoloc.errors import UserError
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Frame, Image

CAMERA = Camera(60.0, 64, 48)
PLACES, HEADINGS = 8, 12


def wall(seed: int) -> Image:
    """A long smooth picture that windows are cut from: views that change slowly with place and heading."""
    noise = np.random.default_rng(seed).normal(size=(60, 300)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 6.0)
    return np.asarray(np.clip(127.0 + 500.0 * smooth, 0, 255), dtype=np.uint8)


def picture(x: float, theta: float, walls: list[Image]) -> Image:
    """What a camera sees at a place and heading: a window of one of the walls, shifted by the place."""
    number = round(theta / (2.0 * np.pi) * HEADINGS) % HEADINGS
    left = round(12.0 * x)
    return np.ascontiguousarray(np.repeat(walls[number][6:54, left : left + 64, None], 3, axis=2))


def appearance_map(count: int = PLACES) -> tuple[TopoMap, Callable[[float, float], Image]]:
    walls = [wall(number) for number in range(HEADINGS)]
    views = [
        View(np.array([float(place), 0.0, 2.0 * np.pi * turn / HEADINGS - np.pi]), image)
        for place in range(count)
        for turn in range(HEADINGS)
        for image in [picture(place, 2.0 * np.pi * turn / HEADINGS - np.pi, walls)]
    ]
    nodes = tuple(Node(str(place), str(place), float(place), 0.0) for place in range(count))
    return TopoMap("appearance", CAMERA, nodes, views=tuple(views)), lambda x, theta: picture(x, theta, walls)


def frame_of(image: Image) -> Frame:
    return Frame(0.0, None, np.zeros(3), {"rgb": image})


def fitted(**settings: Any) -> tuple[PCAMap, TopoMap, Callable[[float, float], Image]]:
    topo_map, see = appearance_map()
    sensor = PCAMap(replace(PCAMapConfig(features=8, columns=32, preprocessing="plain"), **settings))
    sensor.fit(topo_map)
    return sensor, topo_map, see


def test_a_view_of_the_map_is_recognized() -> None:
    sensor, topo_map, _ = fitted()
    for view in topo_map.views[::7]:
        evidence = sensor.observe(frame_of(view.image))
        assert evidence.match[0] == pytest.approx(1.0)
        np.testing.assert_allclose(evidence.poses[0], view.pose)
        assert (np.diff(evidence.match) <= 0.0).all()
        assert len(evidence.poses) == 10


def test_a_frame_between_two_places_names_both() -> None:
    sensor, _, see = fitted(neighbours=4, features=20)
    evidence = sensor.observe(frame_of(see(3.5, -np.pi)))
    assert set(evidence.poses[:2, 0]) == {3.0, 4.0}
    np.testing.assert_allclose(evidence.poses[:2, 2], -np.pi)


def test_features_are_the_projection_of_equation_1() -> None:
    """y = W z with the mean taken off, W's rows orthonormal: the leading eigenvectors of the views' covariance."""
    sensor, topo_map, _ = fitted()
    images = [cv2.resize(view.image[..., 0], (32, 24), interpolation=cv2.INTER_AREA) for view in topo_map.views]
    z = np.array(images, dtype=np.float64).reshape(len(images), -1) / 255.0
    values, vectors = np.linalg.eigh(np.cov(z.T))
    w = vectors[:, ::-1][:, :8].T
    y = (z - z.mean(axis=0)) @ w.T
    ours = np.stack([sensor.describe({"rgb": view.image}) for view in topo_map.views])
    np.testing.assert_allclose(np.abs(ours), np.abs(y), atol=2e-3)  # the sign of an eigenvector is anybody's
    np.testing.assert_allclose(sensor.basis.explained_variance_, values[::-1][:8], rtol=1e-3)


def test_a_set_too_large_for_memory_is_learnt_in_batches_to_the_same_basis() -> None:
    whole, topo_map, _ = fitted()
    parts, _, _ = fitted(memory_mb=0.01)
    assert not np.array_equal(parts.basis.components_, whole.basis.components_)
    overlap = np.linalg.svd(whole.basis.components_[:5] @ parts.basis.components_.T, compute_uv=False)
    assert overlap.min() > 0.98
    frame = frame_of(topo_map.views[40].image)
    assert parts.observe(frame).nodes[0] == whole.observe(frame).nodes[0]


def test_the_basis_follows_views_that_are_added_online() -> None:
    """The seed's further work: half of the views beforehand, the others while the robot drives."""
    topo_map, see = appearance_map()
    half = replace(topo_map, views=topo_map.views[: len(topo_map.views) // 2])
    config = PCAMapConfig(features=12, columns=32, preprocessing="plain")
    whole, grown = PCAMap(config), PCAMap(config)
    whole.fit(topo_map)
    grown.fit(half)
    before = grown.basis.components_
    for first in range(len(half.views), len(topo_map.views), 16):
        grown.extend(topo_map.views[first : first + 16])

    def shared(basis: np.ndarray) -> float:
        """Share of the variance that the whole map's basis keeps which another one keeps, too."""
        z = np.stack([whole._prepared({"rgb": view.image}) for view in topo_map.views])
        z = z - z.mean(axis=0)
        return float(np.sum((z @ basis.T) ** 2) / np.sum((z @ whole.basis.components_.T) ** 2))

    assert shared(grown.basis.components_) > 0.97
    assert shared(grown.basis.components_) > shared(before) + 0.03
    right = sum(int(grown.observe(frame_of(see(place + 0.1, -np.pi))).nodes[0] == place) for place in range(PLACES - 1))
    assert right >= PLACES - 2


def test_views_can_be_added_to_views_only() -> None:
    sensor = PCAMap()
    with pytest.raises(RuntimeError, match="fit"):
        sensor.extend([])
    rng = np.random.default_rng(0)
    panorama = rng.integers(0, 256, (48, 384, 3)).astype(np.uint8)
    nodes = tuple(Node(str(k), str(k), float(k), 0.0, 0.0, np.roll(panorama, 50 * k, axis=1)) for k in range(3))
    sensor.fit(TopoMap("circles", CAMERA, nodes))
    with pytest.raises(UserError, match=r"'circles'.*panoramas only"):
        sensor.extend([View(np.zeros(3), panorama[:, :64])])


@pytest.mark.parametrize("name", sorted(PREPROCESSING))
def test_every_preprocessing_gives_a_grey_picture_of_the_same_size(name: str) -> None:
    image = np.random.default_rng(1).integers(0, 256, (48, 64)).astype(np.uint8)
    assert PREPROCESSING[name](image).shape == image.shape
    sensor, topo_map, _ = fitted(preprocessing=name)
    assert sensor.observe(frame_of(topo_map.views[20].image)).match[0] == pytest.approx(1.0)


def test_equalisation_undoes_a_change_of_gain_and_the_gradient_one_of_offset() -> None:
    image = wall(3)
    darker = np.asarray(0.6 * image, dtype=np.uint8)
    assert np.abs(equalised(image).astype(float) - equalised(darker)).mean() < 2.0
    dim = np.clip(image, 0, 215)
    np.testing.assert_array_equal(gradient(dim + 40), gradient(dim))


def test_the_gradient_of_a_step_is_its_height() -> None:
    step = np.zeros((9, 9), np.uint8)
    step[:, 5:] = 200
    assert gradient(step)[4, 4] == 200
    assert gradient(step.T)[5, 4] == 200
    assert gradient(step)[:, :3].max() == 0


def test_flat_and_covered_pictures_are_blind() -> None:
    sensor, _, _ = fitted()
    assert sensor.observe(frame_of(np.full((48, 64, 3), 90, np.uint8))).is_blind


def test_a_few_views_give_fewer_features() -> None:
    topo_map, _ = appearance_map(1)
    sensor = PCAMap(PCAMapConfig(features=20))
    sensor.fit(replace(topo_map, views=topo_map.views[:5]))
    assert len(sensor.describe({"rgb": topo_map.views[0].image})) == 5


def test_distances_between_pictures_need_no_map() -> None:
    topo_map, _ = appearance_map()
    images = [view.image for view in topo_map.views[::12]]
    between = PCAMap(PCAMapConfig(preprocessing="plain")).distances_between(images)
    assert between.shape == (PLACES, PLACES)
    np.testing.assert_allclose(between, between.T, atol=1e-5)
    np.testing.assert_allclose(np.diag(between), 0.0, atol=1e-5)
    assert between[0, 1] < between[0, 5]


@pytest.mark.parametrize("settings", [{"features": 0}, {"columns": 2}, {"preprocessing": "sepia"}, {"neighbours": -2}])
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        replace(PCAMapConfig(), **settings)
