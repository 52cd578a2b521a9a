"""What IMA precomputes of a map is kept beside it, and used as long as it is the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sensors.ima import IMA, IMAConfig
from sensors.images import cut_views
from sensors.robust_ima import RobustIMA, RobustIMAConfig
from topoloc.picture_index import STORE_FOLDER
from topoloc.pictures import PictureFile
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image, Pixels

CAMERA = Camera(40.0, 96, 72)
KINDS = [(IMA, IMAConfig), (RobustIMA, RobustIMAConfig)]


def circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8), dtype=np.uint8))


def frame_of(panorama: Image, number: int = 5) -> Frame:
    return Frame(0.0, None, np.zeros(3), {"rgb": cut_views(panorama, 0.0, CAMERA)[number][0]})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    nodes = tuple(Node(str(k), str(k), float(k), 0.0, 0.1, circle(k)) for k in range(8))
    TopoMap("m", CAMERA, nodes).save(tmp_path / "m")
    return tmp_path / "m"


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the pictures that were decoded since."""
    names: list[str] = []
    read = PictureFile.read

    def noted(picture: PictureFile) -> Image:
        names.append(picture.path.name)
        return read(picture)

    monkeypatch.setattr(PictureFile, "read", noted)
    return names


def opened(folder: Path, sensor: Any) -> Any:
    sensor.fit(TopoMap.load(folder))
    return sensor


@pytest.mark.parametrize(("kind", "config"), KINDS)
@pytest.mark.parametrize("candidates", [0, 2])
def test_the_second_opening_reads_no_picture_and_says_the_same(
    folder: Path, decoded: list[str], kind: Any, config: Any, candidates: int
) -> None:
    first = opened(folder, kind(config(candidates=candidates)))
    assert set(decoded) == {f"{number}.png" for number in range(8)}
    decoded.clear()
    second = opened(folder, kind(config(candidates=candidates)))
    assert not decoded
    one, other = (sensor.observe(frame_of(circle(1))) for sensor in (first, second))
    np.testing.assert_array_equal(one.match, other.match)
    np.testing.assert_array_equal(one.log_likelihoods, other.log_likelihoods)


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ({"slope": 9.0}, False),
        ({"memory_mb": 1.0}, False),
        ({"slots": 4}, True),
        ({"zoom": 1.2}, True),
        ({"clahe": False}, True),
        ({"candidates": 2}, True),
    ],
)
def test_only_settings_that_pictures_are_prepared_by_make_them_anew(
    folder: Path, decoded: list[str], change: dict[str, Any], again: bool
) -> None:
    opened(folder, IMA())
    decoded.clear()
    opened(folder, IMA(IMAConfig(**change)))
    assert bool(decoded) == again


def test_how_many_candidates_there_are_does_not_matter(folder: Path, decoded: list[str]) -> None:
    opened(folder, IMA(IMAConfig(candidates=1)))
    decoded.clear()
    opened(folder, IMA(IMAConfig(candidates=2)))
    assert not decoded


def test_a_changed_panorama_is_prepared_anew(folder: Path) -> None:
    opened(folder, IMA())
    nodes = tuple(Node(str(k), str(k), float(k), 0.0, 0.1, circle(k + 10)) for k in range(8))
    TopoMap("m", CAMERA, nodes).save(folder, overwrite=True)
    assert opened(folder, IMA()).observe(frame_of(circle(11))).match.argmax() == 1


@pytest.mark.parametrize("candidates", [0, 2])
def test_exchanging_a_panorama_leaves_what_is_kept_as_it_was(folder: Path, candidates: int) -> None:
    opened(folder, IMA(IMAConfig(candidates=candidates)))
    mapped = opened(folder, IMA(IMAConfig(candidates=candidates)))
    mapped.replace_panorama(0, circle(50))
    seen = mapped.observe(frame_of(circle(50)))
    assert seen.nodes[seen.match.argmax()] == 0 and seen.match.max() > 0.9
    other = opened(folder, IMA(IMAConfig(candidates=candidates))).observe(frame_of(circle(0)))
    assert other.nodes[other.match.argmax()] == 0 and other.match.max() > 0.9


def test_another_way_of_preparing_is_not_mistaken_for_ours(folder: Path) -> None:
    """An outsider's subclass that names no store of its own neither reads ours nor fills it."""

    class Inverted(IMA):
        def _prepared(self, picture: Image, circular: bool = False) -> Pixels:
            return 255 - picture if circular else picture

    opened(folder, IMA())
    before = sorted(path.name for path in (folder / STORE_FOLDER).iterdir())
    inverted = opened(folder, Inverted())
    assert inverted.observe(frame_of(circle(1))).match.max() < 0.7
    assert sorted(path.name for path in (folder / STORE_FOLDER).iterdir()) == before
