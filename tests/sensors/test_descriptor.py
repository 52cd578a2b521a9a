"""Any descriptor: a function, an ONNX file written here byte by byte, vectors computed beforehand, a small picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimators.markov import MarkovGrid
from sensors.descriptor import Descriptor, DescriptorConfig
from sensors.images import grey, views_of
from sensors.onnx_model import OnnxModel
from sensors.precomputed import FrameVectors, read_vectors
from topoloc import plugins
from topoloc.errors import InputError, UserError
from topoloc.localizer import Localizer
from topoloc.testing import check_sensor
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 48, 36)
NODES = 6


def scene(node: int) -> Image:
    """A panorama of patches that no other has."""
    rng = np.random.default_rng(node)
    return rng.integers(0, 256, (9, 108, 3)).astype(np.uint8).repeat(4, axis=0).repeat(4, axis=1)


def the_map(views: bool) -> TopoMap:
    """Nodes in a row with panoramas, or with the views that are cut from them as training views."""
    nodes = tuple(Node(f"n{k}", f"n{k}", float(k), 0.0, 0.3, scene(k)) for k in range(NODES))
    whole = TopoMap("row", CAMERA, nodes)
    if not views:
        return whole
    cut = views_of(whole)
    return replace(whole, views=tuple(View(pose, image) for pose, image in zip(cut.poses, cut.images, strict=True)))


def frame_of(image: Image, time: float = 0.0) -> Frame:
    return Frame(time, None, np.zeros(3), {"rgb": image})


def noisy(image: Image, seed: int) -> Image:
    rng = np.random.default_rng(seed)
    return np.clip(image + rng.normal(0.0, 12.0, image.shape), 0, 255).astype(np.uint8)


class Patches:
    """A convolution of patches beside each other, and a rectifier, in numpy and as the bytes of an ONNX file."""

    def __init__(self, channels: int = 3, features: int = 4, side: int = 6) -> None:
        rng = np.random.default_rng(7)
        self.weights = rng.normal(size=(features, channels, side, side)).astype(np.float32)
        self.bias = rng.normal(size=features).astype(np.float32)

    def __call__(self, planes: np.ndarray) -> np.ndarray:
        """Of (channels, rows, cols), flattened."""
        _, channels, side, _ = self.weights.shape
        patches = planes.reshape(channels, planes.shape[1] // side, side, planes.shape[2] // side, side)
        summed = np.einsum("crylx,kcyx->krl", patches, self.weights)
        return np.asarray(np.maximum(summed + self.bias[:, None, None], 0.0)).ravel()

    def write(self, path: Path, dims: tuple[int | str, ...] = (1, 3, 36, 48), outputs: int = 1) -> Path:
        side = self.weights.shape[2]
        weights = [_tensor("w", self.weights), _tensor("b", self.bias)]
        convolved = _node("Conv", ["x", "w", "b"], "c", kernel_shape=side, strides=side)
        graph = [_field(1, convolved), _field(1, _node("Relu", ["c"], "y")), _field(2, "patches")]
        graph += [_field(5, one) for one in weights] + [
            _field(11, _value("x", dims)),
            _field(11, _value("w", self.weights.shape)),
        ]
        graph += [_field(12, _value("y", ("n", "k", "r", "l")))] * outputs
        opset = _field(1, "") + _field(2, 13)
        path.write_bytes(_field(1, 8) + _field(7, b"".join(graph)) + _field(8, opset))
        return path


def _varint(number: int) -> bytes:
    low, rest = number & 127, number >> 7
    return bytes([low | 128]) + _varint(rest) if rest else bytes([low])


def _field(number: int, value: int | str | bytes) -> bytes:
    """A field of a protobuf message."""
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, values: np.ndarray) -> bytes:
    dims = b"".join(_field(1, dim) for dim in values.shape)
    return dims + _field(2, 1) + _field(8, name) + _field(9, values.astype("<f4").tobytes())


def _value(name: str, dims: tuple[int | str, ...]) -> bytes:
    shape = b"".join(_field(1, _field(1 if isinstance(dim, int) else 2, dim)) for dim in dims)
    return _field(1, name) + _field(2, _field(1, _field(1, 1) + _field(2, shape)))


def _node(kind: str, inputs: list[str], output: str, **pairs: int) -> bytes:
    attributes = b"".join(_field(5, _field(1, key) + _field(8, n) * 2 + _field(20, 7)) for key, n in pairs.items())
    return b"".join(_field(1, one) for one in inputs) + _field(2, output) + _field(4, kind) + attributes


def runtimes() -> list[Any]:
    missing = pytest.mark.skipif(not _installed("onnxruntime"), reason="onnxruntime is not installed")
    return ["opencv", pytest.param("onnxruntime", marks=missing)]


def _installed(package: str) -> bool:
    from importlib.util import find_spec

    return find_spec(package) is not None


class TestNetwork:
    @pytest.mark.parametrize("runtime", runtimes())
    def test_it_gives_what_the_same_network_gives_in_numpy(self, tmp_path: Path, runtime: Any) -> None:
        network, image = Patches(), noisy(scene(0)[:, :48], 1)
        mean, std = (0.4, 0.5, 0.6), (0.2, 0.3, 0.25)
        planes = ((image / 255.0 - np.array(mean)) / np.array(std)).transpose(2, 0, 1)
        expected = network(planes)
        assert (expected > 0.0).mean() > 0.2
        fixed = OnnxModel(network.write(tmp_path / "m.onnx"), (0, 0), mean, std, runtime)
        np.testing.assert_allclose(fixed(image), expected, atol=1e-4)
        free = OnnxModel(network.write(tmp_path / "f.onnx", ("n", 3, "h", "w")), (48, 36), mean, std, runtime)
        np.testing.assert_allclose(free(image), expected, atol=1e-4)
        grey_network = Patches(channels=1)
        one = OnnxModel(grey_network.write(tmp_path / "g.onnx", (1, 1, 36, 48)), runtime=runtime)
        np.testing.assert_allclose(one(image), grey_network(grey(image)[None] / 255.0), atol=1e-4)

    def test_pictures_are_scaled_to_its_size(self, tmp_path: Path) -> None:
        model = OnnxModel(Patches().write(tmp_path / "m.onnx"))
        image = scene(3)[:, :48]
        np.testing.assert_allclose(model(image.repeat(2, axis=0).repeat(2, axis=1)), model(image), atol=1e-4)

    @pytest.mark.parametrize("runtime", runtimes())
    def test_it_localizes_with_an_estimator(self, tmp_path: Path, runtime: str) -> None:
        """End to end, by the settings of the command line."""
        path = Patches().write(tmp_path / "m.onnx")
        chosen = {"model": str(path), "mean": "0.5", "std": "0.25", "runtime": runtime}
        sensor = plugins.make_sensor("descriptor", chosen)
        row = the_map(views=True)
        localizer = Localizer(row, sensor, MarkovGrid())
        for node in range(NODES):
            view = row.views[24 * node + 5]
            frame = replace(frame_of(noisy(view.image, node), float(node)), odometry=view.pose)
            estimate = localizer.step(frame)
            assert localizer.last is not None and localizer.last.evidence is not None
            assert int(localizer.last.evidence.match.argmax()) == 0
            np.testing.assert_allclose(localizer.last.evidence.poses[0], view.pose)
        assert estimate.node == NODES - 1

    @pytest.mark.parametrize(
        ("dims", "settings", "problem"),
        [
            ((1, 3, "h", "w"), {}, "any width; set width"),
            ((1, 3, 36, 48), {"width": 64}, "width of 48, not 64; leave the setting width out"),
            ((1, 7, 36, 48), {}, "its input is 1 x 7 x 36 x 48"),
            ((1, 99), {}, "its input is 1 x 99"),
            ((1, 3, 36, 48), {"mean": (0.1, 0.2)}, "3 channels, and mean 2 values"),
        ],
    )
    def test_an_input_that_does_not_fit_is_refused(
        self, tmp_path: Path, dims: tuple[int | str, ...], settings: dict[str, Any], problem: str
    ) -> None:
        path = Patches().write(tmp_path / "m.onnx", dims)
        with pytest.raises(InputError, match=problem) as caught:
            Descriptor(DescriptorConfig(model=str(path), **settings))
        assert "\n" not in str(caught.value)

    def test_a_file_that_is_none_is_refused(self, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        path = tmp_path / "m.onnx"
        with pytest.raises(InputError, match=r"cannot be read .*; name the ONNX file"):
            OnnxModel(path)
        whole = Patches().write(path).read_bytes()
        for data in (b"", b"a text", whole[: len(whole) // 2], whole[:-1], b"\x0f" * 30, b"\xff" * 30):
            path.write_bytes(data)
            with pytest.raises(InputError, match="is no ONNX file"):
                OnnxModel(path)
        with pytest.raises(InputError, match="1 inputs and 2 outputs"):
            OnnxModel(Patches().write(path, outputs=2))
        path.write_bytes(whole.replace(b"Relu", b"Rulu"))
        with pytest.raises(InputError, match="OpenCV cannot read it") as caught:
            OnnxModel(path)
        assert "\n" not in str(caught.value)
        assert capfd.readouterr().err == ""

    @pytest.mark.skipif(_installed("onnxruntime"), reason="it is installed")
    def test_onnxruntime_is_asked_for_by_name(self, tmp_path: Path) -> None:
        with pytest.raises(UserError, match="needs the package 'onnxruntime'; install it"):
            OnnxModel(Patches().write(tmp_path / "m.onnx"), runtime="onnxruntime")


def corners(image: Image) -> np.ndarray:
    """A descriptor of two dimensions, which is flattened."""
    return np.asarray(image[::12, ::12].mean(axis=2))


class TestFunction:
    @pytest.mark.parametrize("distance", ["cosine", "euclidean"])
    @pytest.mark.parametrize("views", [True, False])
    def test_a_view_of_the_map_is_recognized(self, distance: Any, views: bool) -> None:
        row = the_map(views)
        sensor = Descriptor(DescriptorConfig(distance=distance), corners)
        sensor.fit(row)
        known = views_of(row)
        for index in range(0, len(known.images), 13):
            evidence = sensor.observe(frame_of(known.images[index]))
            assert evidence.match[0] == pytest.approx(1.0, abs=1e-4)
            np.testing.assert_allclose(evidence.poses[0], known.poses[index])

    def test_it_is_given_colour_always(self) -> None:
        shapes = []

        def watching(image: Image) -> np.ndarray:
            shapes.append((image.shape, image.dtype))
            return corners(image)

        sensor = Descriptor(function=watching)
        check_sensor(sensor, the_map(True), [frame_of(scene(k)[:, :48]) for k in range(3)])
        assert set(shapes) == {((36, 48, 3), np.dtype(np.uint8))}

    @pytest.mark.parametrize(
        ("function", "problem"),
        [
            (lambda image: np.full(3, np.nan), "holds what is no finite number"),
            (lambda image: [], "is empty"),
            (lambda image: np.arange(1 + image[0, 0, 0] % 7), "from 1 to 7 numbers"),
        ],
    )
    def test_what_is_no_vector_is_refused(self, function: Callable[[Image], Any], problem: str) -> None:
        with pytest.raises(UserError, match=problem):
            Descriptor(function=function).fit(the_map(True))

    def test_frames_of_another_length_than_the_map_are_refused(self) -> None:
        sensor = Descriptor(function=lambda image: image[::12, ::12, 0])
        sensor.fit(the_map(True))
        with pytest.raises(UserError, match="a descriptor has 48 numbers, and those of the map's views 12"):
            sensor.observe(frame_of(scene(0)[:, :48].repeat(2, axis=0).repeat(2, axis=1)))


class TestDistances:
    @pytest.mark.parametrize("offset", [0.0, 1e4])
    def test_they_are_what_their_names_say(self, offset: float) -> None:
        """Far from the origin, too, where squares are large beside their differences."""
        rng = np.random.default_rng(0)
        one, other = rng.normal(size=(4, 30)) + offset, rng.normal(size=(9, 30)) + offset
        lengths = np.linalg.norm(one, axis=1)[:, None] * np.linalg.norm(other, axis=1)
        expected = {
            "euclidean": np.linalg.norm(one[:, None] - other, axis=2),
            "cosine": 1.0 - one @ other.T / lengths,
        }
        for name, distances in expected.items():
            rows = iter([*one, *other])
            sensor = Descriptor(DescriptorConfig(distance=name), lambda image, rows=rows: next(rows))  # type: ignore[arg-type, misc]
            made = np.stack([sensor.describe({"rgb": scene(0)}) for _ in range(13)])
            np.testing.assert_allclose(sensor.distances(made[:4], made[4:]), distances, rtol=1e-6, atol=1e-6)

    def test_without_settings_it_is_the_correlation_of_whole_pictures(self) -> None:
        rng = np.random.default_rng(1)
        pictures = [rng.integers(0, 256, (24, 32)).astype(np.uint8) for _ in range(4)]
        expected = 1.0 - np.corrcoef([picture.ravel() for picture in pictures])
        np.testing.assert_allclose(Descriptor().distances_between(pictures), expected, atol=1e-5)
        dimmed = [(0.5 * picture + 20).astype(np.uint8) for picture in pictures[:1]]
        assert Descriptor().distances_between([pictures[0], *dimmed])[0, 1] < 1e-3

    def test_it_keeps_the_contract_of_sensors(self) -> None:
        for row in (the_map(True), the_map(False)):
            check_sensor(Descriptor(), row, [frame_of(scene(k)[:, 8:56]) for k in range(3)])

    def test_cuts_of_another_size_than_frames_are_compared_with_them(self) -> None:
        """Columns of a panorama are rounded, and it may be smaller than what the camera gives."""
        row = the_map(False)
        small = tuple(replace(node, panorama=scene(k)[::4, :430:4]) for k, node in enumerate(row.nodes))
        sensor = Descriptor()
        sensor.fit(replace(row, nodes=small))
        found = sensor.observe(frame_of(views_of(row).images[24 * 2 + 6]))
        assert (found.nodes[0], found.poses[0, 0]) == (2, 2.0)


class TestPrecomputed:
    """The rows of a model that ran elsewhere: those of ``corners``."""

    TIMES = (0.5, 1.25, 2.0)

    def files(self, folder: Path, row: TopoMap) -> dict[str, Any]:
        views = views_of(row)
        np.save(folder / "map.npy", [corners(image).ravel() for image in views.images])
        np.save(folder / "frames.npy", [corners(image).ravel() for image in self.images(row)])
        lines = [f"{time:.6f} rgb/{number}.png" for number, time in enumerate(self.TIMES)]
        (folder / "rgb.txt").write_text("# timestamp path\n\n" + "\n".join(lines) + "\n")
        names = {"map_vectors": "map.npy", "frame_vectors": "frames.npy", "frame_times": "rgb.txt"}
        return {key: str(folder / name) for key, name in names.items()}

    def images(self, row: TopoMap) -> list[Image]:
        known = views_of(row).images
        return [noisy(known[24 * k + 3], k) for k in range(len(self.TIMES))]

    @pytest.mark.parametrize("views", [True, False])
    def test_it_says_what_the_model_itself_would(self, tmp_path: Path, views: bool) -> None:
        row = the_map(views)
        known, asked = Descriptor(DescriptorConfig(**self.files(tmp_path, row))), Descriptor(function=corners)
        for sensor in (known, asked):
            sensor.fit(row)
        for image, time in zip(self.images(row), self.TIMES, strict=True):
            one, other = (sensor.observe(frame_of(image, time)) for sensor in (known, asked))
            np.testing.assert_allclose(one.poses, other.poses)
            np.testing.assert_allclose(one.log_likelihoods, other.log_likelihoods, atol=1e-9)
        assert known.observe(frame_of(np.zeros((36, 48, 3), np.uint8), self.TIMES[0])).is_blind

    def test_a_frame_without_a_row_is_refused(self, tmp_path: Path) -> None:
        row = the_map(True)
        sensor = Descriptor(DescriptorConfig(**self.files(tmp_path, row)))
        sensor.fit(row)
        image = self.images(row)[0]
        assert not sensor.observe(frame_of(image, 1.2504)).is_blind
        for time in (0.4, 1.3, 1.9, 9.0):
            with pytest.raises(InputError, match=rf"rgb.txt: has no line for the frame at {time}"):
                sensor.observe(frame_of(image, time))
        with pytest.raises(UserError, match="of one map's views alone"):
            sensor.distances_between([image])

    def test_as_many_rows_as_views_and_as_frames(self, tmp_path: Path) -> None:
        row = the_map(True)
        files = self.files(tmp_path, row)
        rows = np.load(files["map_vectors"])
        np.save(files["map_vectors"], rows[1:])
        with pytest.raises(InputError, match=r"map.npy: has 143 rows, and map 'row' 144 training views"):
            Descriptor(DescriptorConfig(**files)).fit(row)
        with pytest.raises(InputError, match=r"144 views that are cut from its panoramas"):
            Descriptor(DescriptorConfig(**files)).fit(the_map(False))
        np.save(files["frame_vectors"], rows[:5])
        with pytest.raises(InputError, match=r"frames.npy: has 5 rows, and .*rgb.txt 3 times"):
            Descriptor(DescriptorConfig(**files))
        np.save(files["map_vectors"], rows)
        np.save(files["frame_vectors"], rows[:3, :7])
        sensor = Descriptor(DescriptorConfig(**files))
        sensor.fit(row)
        with pytest.raises(UserError, match="7 numbers, and those of the map's views 12"):
            sensor.observe(frame_of(self.images(row)[0], self.TIMES[0]))

    @pytest.mark.parametrize(
        ("array", "problem"),
        [
            (np.zeros(4), "is an array of 4; write one of pictures x numbers"),
            (np.zeros((0, 4)), "is an array of 0 x 4"),
            (np.zeros(()), "is an array of no dimensions"),
            (np.array([[1.0, 2.0], [np.nan, 0.0]]), "row 1 holds what is no finite number"),
            (np.array([["a", "b"]]), "is no .npy file of numbers"),
            (np.array([[1.0, None]], dtype=object), "is no .npy file of numbers"),
        ],
    )
    def test_an_array_of_another_kind_is_refused(self, tmp_path: Path, array: np.ndarray, problem: str) -> None:
        np.save(tmp_path / "v.npy", array, allow_pickle=True)
        with pytest.raises(InputError, match=problem):
            read_vectors(tmp_path / "v.npy")

    def test_a_file_of_another_kind_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "v.npy"
        with pytest.raises(InputError, match=r"cannot be read .*; write it with numpy\.save"):
            read_vectors(path)
        np.save(path, np.zeros((4, 4)))
        whole = path.read_bytes()
        for data in (b"", b"a text", whole[:-40], whole[:20]):
            path.write_bytes(data)
            with pytest.raises(InputError, match=r"write it with numpy\.save"):
                read_vectors(path)
        with path.open("wb") as file:
            np.savez(file, np.zeros((4, 4)))
        with pytest.raises(InputError, match=r"is no \.npy file"):
            read_vectors(path)

    @pytest.mark.parametrize("text", ["0.5\nsoon\n", "0.5\n0.5\n", "2\n1\n", "nan\n"])
    def test_times_increase(self, tmp_path: Path, text: str) -> None:
        np.save(tmp_path / "v.npy", np.zeros((2, 3)))
        (tmp_path / "t.txt").write_text(text)
        with pytest.raises(InputError, match=r"t.txt, line \d: .* is no time after those before it"):
            FrameVectors.read(tmp_path / "v.npy", tmp_path / "t.txt")


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"map_vectors": "a.npy"}, "belong together; set all three"),
        ({"frame_vectors": "a.npy", "frame_times": "b.txt"}, "belong together"),
        ({"map_vectors": "a", "frame_vectors": "b", "frame_times": "c", "model": "d"}, "choose one"),
        ({"columns": 1}, "columns is 1"),
        ({"width": -1}, "must not be negative"),
        ({"std": (0.0,)}, "std must be positive"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        DescriptorConfig(**settings)


def test_without_a_map_it_says_what_to_call() -> None:
    with pytest.raises(RuntimeError, match="fit"):
        Descriptor().observe(frame_of(scene(0)[:, :48]))
