"""Place recognition across the laps of a recording: ``python -m benchmarks.place_recognition FOLDER`` prints a table.

The first lap is the map, every frame of the second a query; a query is right where the frame of the first lap that it
is taken for is one of those that ``loop_pairs.csv`` names. Alone: the best match. In sequence: causal sequence matching
through its own interface, over this query and those before it, with the lap laid out as a line.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from estimators.sequence import SequenceMatching
from sensors.calibration import WRONG_M
from sensors.descriptor import Descriptor, DescriptorConfig
from sensors.disparity import Disparity, DisparityConfig
from sensors.fourier import FourierSignature, FourierSignatureConfig
from sensors.histogram import ColorHistogram, ColorHistogramConfig
from sensors.ima import IMA
from sensors.images import grey, resize
from sensors.local import LocalFeatures, LocalFeaturesConfig
from sensors.pca import PCAMap, PCAMapConfig
from sensors.robust_ima import RobustIMA
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.cli.progress import bar
from topoloc.errors import InputError, UserError
from topoloc.estimate import node_masses
from topoloc.files import read_text, write_bytes, write_text
from topoloc.geometry import Floats
from topoloc.interfaces import Sensor
from topoloc.plan import as_png
from topoloc.recording import Recording
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image, Motion, WeightedPoses

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCUMENT = Path(__file__).parents[1] / "docs" / "real_images.md"
PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "real_images.png"
BEGIN, END = "<!-- written by python -m benchmarks.place_recognition -->\n", "<!-- end -->\n"
"""What the table stands between."""
HFOV_DEG = 66.5
"""Of the corridor's camera, from the calibration beside its stereo pairs: 640 columns, focal length 487.6."""
FRAME_M = 0.4
"""From frame to frame along the line [m]: two frames then are within what counts as the same place, as in the truth."""
SPEEDS = (0.8, 0.9, 1.0, 1.1, 1.2)
"""Of the second lap beside the first, frames a frame, equally likely before: those that SeqSLAM tries."""
COLUMNS = 72
"""Pictures are scaled down to so many for correlation, as for IMA."""
MOST_SHIFT = 0.25
"""Share of the width that sideways shifts go to."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Laps:
    """Two laps of one way.

    Attributes:
        first: V frames, the map.
        second: Q frames, the queries.
        right: (Q, V) which frames of the first lap show the place of a query.
    """

    first: Sequence[Frame]
    second: Sequence[Frame]
    right: Mask

    @classmethod
    def load(cls, folder: Path) -> Laps:
        """A recording with ``loop_pairs.csv``: ``query_image,earlier_image``, numbers of frames from 1 on.

        The first lap ends before the first query. Earlier frames that belong to the second lap are left out.
        """
        path = folder / "loop_pairs.csv"
        text = read_text(path, "name a folder such as corridor_two_laps, with rgb.txt and loop_pairs.csv")
        try:
            pairs = np.array([[int(word) for word in row] for row in list(csv.reader(text.splitlines()))[1:]])
            queries, _ = (np.unique(column) for column in pairs.T)
        except (ValueError, IndexError):
            raise InputError(path, "is no list of pairs", "write query_image,earlier_image, whole numbers") from None
        frames = list(Recording.load(folder))
        start = int(queries[0]) - 1
        if start < 1 or queries[-1] > len(frames) or pairs.min() < 1:
            raise InputError(
                path, f"names frames outside 1 to {len(frames)}", "count frames from 1, as rgb.txt has them"
            )
        right = np.zeros((len(frames) + 1, len(frames) + 1), dtype=np.bool_)
        right[pairs[:, 0], pairs[:, 1]] = True
        return cls(frames[:start], [frames[query - 1] for query in queries], right[queries, 1 : start + 1])

    @cached_property
    def topo_map(self) -> TopoMap:
        """The first lap as a line along x, a node and a view for each frame."""
        images = [frame.images["rgb"] for frame in self.first]
        places = [(FRAME_M * number, 0.0) for number in range(len(images))]
        return TopoMap(
            "first lap",
            Camera(HFOV_DEG, images[0].shape[1], images[0].shape[0]),
            tuple(Node(str(number + 1), f"frame {number + 1}", x, y) for number, (x, y) in enumerate(places)),
            views=tuple(View(np.array([x, y, 0.0]), image) for (x, y), image in zip(places, images, strict=True)),
        )


class PairSensor(ViewSensor):
    """Any likeness of two pictures, 1 for identical ones, as a sensor: its distance is what is missing to 1.

    So IMA matches single images (thesis 5.1.1), where a map has no panoramas.
    """

    def __init__(
        self, likeness: Callable[[Any, Any], float], prepare: Callable[[Image], NDArray[Any]] | None = None
    ) -> None:
        super().__init__(ViewConfig(neighbours=0))
        self._likeness, self._prepare = likeness, prepare

    def describe(self, pictures: Pictures) -> NDArray[Any]:
        """What is compared: the picture, prepared."""
        return pictures["rgb"] if self._prepare is None else self._prepare(pictures["rgb"])

    def distances(self, queries: NDArray[Any], others: NDArray[Any]) -> Floats:
        """(Q, V) of prepared pictures (Q, ...) and (V, ...)."""
        return np.array([[1.0 - self._likeness(one, other) for other in others] for one in queries])


def scaled(image: Image) -> Floats:
    """Grey levels (rows, COLUMNS) of a picture, its aspect kept."""
    return resize(grey(image), COLUMNS, round(COLUMNS * image.shape[0] / image.shape[1])).astype(np.float64)


def correlation(first: Floats, second: Floats, most_shift: float = 0.0) -> float:
    """Normalised correlation of whole pictures (rows, columns); the best of shifts of up to a share of the width."""
    most = round(most_shift * first.shape[1])
    return max(_overlapping(first, second, shift) for shift in range(-most, most + 1))


def _overlapping(first: Floats, second: Floats, shift: int) -> float:
    """Correlation of what two pictures share when the second is shifted right by so many columns."""
    columns = first.shape[1]
    ours = first[:, max(0, shift) : columns + min(0, shift)]
    theirs = second[:, max(0, -shift) : columns + min(0, -shift)]
    return float(np.corrcoef(ours.ravel(), theirs.ravel())[0, 1])


def single_images(ima: IMA, one: Image, other: Image) -> float:
    """Match of IMA between two single images."""
    return ima.compare(one, other)[0]


def competitors() -> Mapping[str, Callable[[], Sensor]]:
    """What is compared, by name; every view of the map is a hypothesis, so that a sequence can ask for any."""
    return {
        "whole-image correlation": lambda: PairSensor(correlation, scaled),
        "the same, shifted sideways": lambda: PairSensor(partial(correlation, most_shift=MOST_SHIFT), scaled),
        "ima, single images": lambda: PairSensor(partial(single_images, IMA())),
        "ima-robust, single images": lambda: PairSensor(partial(single_images, RobustIMA())),
        "pca": lambda: PCAMap(PCAMapConfig(neighbours=0)),
        "histogram": lambda: ColorHistogram(ColorHistogramConfig(neighbours=0)),
        "descriptor": lambda: Descriptor(DescriptorConfig(neighbours=0)),
        "local": lambda: LocalFeatures(LocalFeaturesConfig(neighbours=0)),
        "local, orb": lambda: LocalFeatures(LocalFeaturesConfig(neighbours=0, features="orb")),
        "fourier": lambda: FourierSignature(FourierSignatureConfig(neighbours=0)),
        "disparity": lambda: Disparity(DisparityConfig(neighbours=0)),
    }


@dataclass(frozen=True)
class Found:
    """What queries are taken for.

    Attributes:
        sure: (Q,) how sure each answer is; -inf where there is none.
        right: (Q,) whether it is right.
    """

    sure: Floats
    right: Mask

    @property
    def first_matches(self) -> int:
        """How many answers are right: recall at 1 times Q."""
        return int(self.right.sum())

    def curve(self) -> tuple[Floats, Floats]:
        """Precision and recall (Q,), of the surest answer alone, the two surest, ...; equally sure ones together."""
        order = np.argsort(-self.sure, kind="stable")
        right, number = np.cumsum(self.right[order]), np.arange(1, len(order) + 1)
        sure = self.sure[order]
        last = np.append(sure[1:] != sure[:-1], True) & (sure > -np.inf)
        return right[last] / number[last], right[last] / len(order)

    def recall_at_full_precision(self) -> float:
        """Share of the queries that are answered, and right, before the first wrong answer."""
        precision, recall = self.curve()
        return float(recall[precision == 1.0].max(initial=0.0))

    def average_precision(self) -> float:
        """Area under the precision-recall curve: the mean over all queries, those never answered rightly counting 0."""
        precision, recall = self.curve()
        return float(np.diff(recall, prepend=0.0) @ precision)


def alone(seen: Sequence[Evidence], right: Mask) -> Found:
    """The best match of each query; a blind one is no answer."""
    best = [None if one.is_blind else int(one.match.argmax()) for one in seen]
    answers = [None if k is None else int(one.nodes[k]) for one, k in zip(seen, best, strict=True)]
    sure = [-np.inf if k is None else float(one.match[k]) for one, k in zip(seen, best, strict=True)]
    return _judged(answers, sure, right)


def in_sequence(seen: Sequence[Evidence], topo_map: TopoMap, right: Mask) -> Found:
    """The node that causal sequence matching believes in most at each query, surer the less it believes in others.

    One sequence matching a speed; their scores are sums over the same looks, so that their beliefs add up to one over
    places and speeds.
    """
    runs = [(SequenceMatching(), Motion(np.array([speed * FRAME_M, 0.0, 0.0]), np.zeros((3, 3)))) for speed in SPEEDS]
    for run, _ in runs:
        run.reset(topo_map, np.random.default_rng(0))
    answers, sure = [], []
    for evidence in seen:
        for run, motion in runs:
            run.predict(motion)
            run.update(evidence)
        belief = _pooled([run.belief for run, _ in runs])
        answers.append(int(node_masses(belief, topo_map).argmax()))
        sure.append(_sureness(belief, topo_map.positions[answers[-1]]))
    return _judged(answers, sure, right)


def _pooled(beliefs: Sequence[WeightedPoses]) -> WeightedPoses:
    """One belief of several whose weights have one scale."""
    poses, weights = zip(*((belief.poses, belief.log_weights) for belief in beliefs), strict=True)
    return WeightedPoses(np.concatenate(poses), np.concatenate(weights))


def _sureness(belief: WeightedPoses, place: Floats) -> float:
    """-log of the share of a belief that is at another place than ``place`` (2,); a share itself would round to 1."""
    elsewhere = np.linalg.norm(belief.poses[:, :2] - place, axis=1) >= WRONG_M
    return (
        float(logsumexp(belief.log_weights) - logsumexp(belief.log_weights[elsewhere])) if elsewhere.any() else np.inf
    )


def _judged(answers: Sequence[int | None], sure: Sequence[float], right: Mask) -> Found:
    hits = [answer is not None and bool(right[query, answer]) for query, answer in enumerate(answers)]
    return Found(np.array(sure), np.array(hits, dtype=np.bool_))


@dataclass(frozen=True)
class Row:
    """What a sensor finds, or why it cannot.

    Attributes:
        name: of the sensor.
        alone, sequence: by itself, and in sequence; None where it cannot.
        reason: why not.
    """

    name: str
    alone: Found | None = None
    sequence: Found | None = None
    reason: str = ""


def measure(name: str, make: Callable[[], Sensor], laps: Laps) -> Row:
    """One sensor over the laps."""
    sensor = make()
    try:
        sensor.fit(laps.topo_map)
    except UserError as error:
        return Row(name, reason=str(error).partition(": ")[2] or str(error))
    seen = [sensor.observe(frame) for frame in laps.second]
    return Row(name, alone(seen, laps.right), in_sequence(seen, laps.topo_map, laps.right))


def rows(laps: Laps) -> Iterator[Row]:
    """Every competitor in turn."""
    return (measure(name, make, laps) for name, make in competitors().items())


def table(measured: Sequence[Row]) -> str:
    """A table in Markdown: right answers, recall before the first wrong one, and the area under the curve."""
    head = "right alone | recall at full precision | average precision"
    lines = [f"| sensor | {head} | {head.replace('alone', 'in sequence')} |", "|---|---|---|---|---|---|---|"]
    for row in measured:
        if row.alone is None or row.sequence is None:
            lines.append(f"| {row.name} | cannot: {row.reason} | | | | | |")
            continue
        lines.append(f"| {row.name} | {' | '.join(_figures(found) for found in (row.alone, row.sequence))} |")
    return "\n".join(lines) + "\n"


def _figures(found: Found) -> str:
    return f"{found.first_matches} | {found.recall_at_full_precision():.2f} | {found.average_precision():.2f}"


def figure(measured: Sequence[Row]) -> Figure:
    """Precision against recall, each sensor alone and in sequence."""
    from matplotlib.figure import Figure

    drawn = Figure((9.0, 3.8), layout="constrained")
    for axes, title in zip(drawn.subplots(1, 2, sharey=True), ("alone", "in sequence"), strict=True):
        for row in measured:
            found = row.alone if title == "alone" else row.sequence
            if found is not None:
                precision, recall = found.curve()
                axes.plot(recall, precision, label=row.name, linewidth=1.4)
        axes.set(title=title, xlabel="recall", xlim=(0.0, 1.0), ylim=(0.0, 1.03))
        axes.grid(alpha=0.3)
    drawn.axes[0].set_ylabel("precision")
    drawn.legend(*drawn.axes[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    return drawn


def main() -> None:
    """Measure, and print the table; with --document, put it and the picture into the documents."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="a recording of two laps with loop_pairs.csv")
    parser.add_argument("--document", action="store_true", help=f"put table and picture into docs/{DOCUMENT.name}")
    words = parser.parse_args()
    try:
        laps = Laps.load(words.folder)
    except UserError as error:
        parser.error(str(error))
    with threadpool_limits(1), bar() as progress:
        measured = list(progress.track(rows(laps), total=len(competitors()), description="recognizing places"))
    print(table(measured))
    if words.document:
        text = DOCUMENT.read_text(encoding="utf-8")
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        write_text(DOCUMENT, before + BEGIN + table(measured) + END + after)
        write_bytes(PICTURE, as_png(figure(measured)))


if __name__ == "__main__":
    main()
