"""A drive, looks and answers made small enough for a report to hold them."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np

from benchmarks.replay.values import (
    Account,
    Answer,
    Cell,
    Drive,
    Hypothesis,
    Line,
    Look,
    NodeSeen,
    Pose,
    Slots,
)
from benchmarks.scenarios import Case
from estimators.activity import Hypotheses, TrackerStep
from sensors import IMA
from sensors.fusion import Fusion
from topoloc.geometry import Floats
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Step
from topoloc.plan import dead_reckoning
from topoloc.recording import LazyImages
from topoloc.types import Evidence, Frame, Pixels, WeightedPoses

FRAME_WIDTH, PANORAMA_WIDTH, JPEG_QUALITY = 256, 1296, 55
"""Pictures are kept small: a report holds some hundred of them."""
MOST_FRAMES = 400
"""Of a longer drive, every second frame has its picture, or every third, and so on."""
MOST_PANORAMAS = 60
"""Maps of more nodes are shown without panoramas, or the report would not be opened."""
SHOWN_HYPOTHESES = 8
"""So many of a look's hypotheses are kept, those of the best match."""
SHOWN_SLOTS = 4
"""So many of them with the slots."""
SHOWN_PLACES, FINEST_M = 80, 0.1
"""A belief is summed up in at most so many square cells, of this side or, where it is spread wider, larger ones."""
MOST_COLUMNS = 1000
"""Of the finest cells, each way: a belief may reach far."""
LEAST_SHARE = 0.002
"""A cell that holds less of the belief is left out."""


def drive_of(scenario: str, seed: int, case: Case, keep_pictures: bool = True) -> Drive:
    """What is to be seen of a drive, whatever looks at it.

    Args:
        scenario: its name.
        seed: of the drive.
        case: the drive.
        keep_pictures: of the frames, in memory, for the sensors that look at them next.
    """
    every = -(-len(case.frames) // MOST_FRAMES)
    nodes = [
        NodeSeen(
            node.id,
            node.name,
            _metres(node.x),
            _metres(node.y),
            _degrees(node.heading),
            "" if node.panorama is None or len(case.topo_map.nodes) > MOST_PANORAMAS else panorama_url(node.panorama),
        )
        for node in case.topo_map.nodes
    ]
    return Drive(
        scenario,
        seed,
        nodes,
        [(int(a), int(b)) for a, b in np.asarray(case.topo_map.edges)],
        [frame.timestamp for frame in case.frames],
        [_pose(pose) for pose in case.truth],
        [(x, y) for x, y, _ in map(_pose, _reckoned(case))],
        ["" if number % every else _frame_url(frame, keep_pictures) for number, frame in enumerate(case.frames)],
        list(case.kidnapped_at),
    )


def look_of(number: int, frame: Frame, step: Step, sensor: Sensor) -> Look:
    """What a sensor saw in a frame that was looked at, as the step has it."""
    evidence = step.evidence or Evidence.blind()
    best = evidence.best_per_node()
    best = best[np.argsort(-evidence.match[best], kind="stable")][:SHOWN_HYPOTHESES]
    hypotheses = [
        Hypothesis(
            int(evidence.nodes[i]),
            _share(evidence.match[i]),
            round(float(evidence.log_likelihoods[i]), 2),
            *_pose(evidence.poses[i])[:2],
            _degrees(evidence.poses[i, 2]) if evidence.kappa[i] > 0.0 else None,
        )
        for i in best
    ]
    slots = []
    if (ima := ima_in(sensor)) is not None and hypotheses:
        slots = slots_of(ima, frame.images["rgb"], [hypothesis.node for hypothesis in hypotheses[:SHOWN_SLOTS]])
    return Look(number, hypotheses, slots, step.problem)


def answer_of(step: Step, right: bool, cells: list[Cell], account: Account | None) -> Answer:
    """What an estimator answered, and what it believed then: cells as ``cells_of`` has them, none where gated."""
    estimate = step.estimate
    return Answer(
        step.kind,
        *_pose(estimate.pose),
        estimate.node,
        _share(estimate.probability),
        estimate.status.value,
        right,
        cells,
        account,
    )


def cells_of(belief: WeightedPoses) -> list[Cell]:
    """A belief summed up in few square cells: x and y of their centres of mass, and their shares, largest first."""
    places, weights = belief.poses[:, :2], belief.weights
    low = places.min(axis=0)
    side = max(FINEST_M, float((places.max(axis=0) - low).max()) / MOST_COLUMNS)
    while True:
        column, row = np.floor((places - low) / side).astype(np.int64).T
        index = column * (row.max() + 1) + row
        share = np.bincount(index, weights)
        kept = np.flatnonzero(share > LEAST_SHARE)
        if len(kept) <= SHOWN_PLACES and share[kept].sum() > 0.5:
            break
        side *= 2.0
    x, y = (np.bincount(index, weights * places[:, axis])[kept] / share[kept] for axis in (0, 1))
    order = np.argsort(-share[kept], kind="stable")
    return [(_metres(x[i]), _metres(y[i]), _share(share[kept][i])) for i in order]


def account_of(estimator: Estimator) -> Account | None:
    """The last step of a tracker of the thesis; None for all others, and before its first."""
    step = getattr(estimator, "last", None)
    if not isinstance(step, TrackerStep):
        return None
    return Account(
        step.kind,
        _lines(step.origins),
        _lines(step.destinations),
        step.winner,
        np.round(step.delta_l, 3).tolist(),
        [[_degrees(value) if np.isfinite(value) else None for value in row] for row in step.delta_phi],
    )


def panorama_url(panorama: Pixels) -> str:
    """A panorama as a small picture in a data URL."""
    return _url(panorama, PANORAMA_WIDTH)


def _frame_url(frame: Frame, keep: bool) -> str:
    kind = next((kind for kind in ("rgb", "omni") if kind in frame.images), None)
    if kind is None:
        return ""
    from topoloc.errors import UserError

    try:
        picture = frame.images[kind]
    except UserError:  # the localizer met it, too, and said so
        return ""
    if not keep and isinstance(frame.images, LazyImages):
        frame.images.forget()
    return _url(picture, PANORAMA_WIDTH if picture.shape[1] > 3 * picture.shape[0] else FRAME_WIDTH)


def _url(picture: Pixels, width: int) -> str:
    from PIL import Image as Pictures

    image = Pictures.fromarray(np.ascontiguousarray(picture).astype(np.uint8))
    if image.width > width:
        image = image.resize((width, max(1, round(image.height * width / image.width))), Pictures.Resampling.BOX)
    buffer = io.BytesIO()
    image.convert("RGB").save(buffer, format="JPEG", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode()


def ima_in(sensor: Sensor) -> IMA | None:
    """The first IMA, or relative of it, that a sensor is or fuses."""
    if isinstance(sensor, IMA):
        return sensor
    parts = sensor.parts if isinstance(sensor, Fusion) else ()
    return next((found for part in parts if (found := ima_in(part)) is not None), None)


def slots_of(sensor: IMA, image: Pixels, nodes: Sequence[int]) -> list[Slots]:
    """Where a full-size frame has its slots on the panoramas of nodes."""
    return [
        Slots(
            node,
            _share(found.match),
            [_share(left) for left in found.left],
            _share(found.width),
            [_share(value) for value in found.value],
            found.counted.tolist(),
        )
        for node, found in zip(nodes, sensor.slots(image.astype(np.uint8, copy=False), nodes), strict=True)
    ]


def _lines(hypotheses: Hypotheses) -> list[Line]:
    return [
        Line(
            int(hypotheses.nodes[i]),
            _degrees(hypotheses.headings[i]) if np.isfinite(hypotheses.headings[i]) else None,
            _share(hypotheses.match[i]) if np.isfinite(hypotheses.match[i]) else None,
            _share(hypotheses.activity[i]),
            bool(hypotheses.virtual[i]),
        )
        for i in range(len(hypotheses))
    ]


def _reckoned(case: Case) -> Floats:
    """(N, 3) where the odometer alone puts the robot, from its true start on; (0, 3) where it has none."""
    readings = [frame.odometry for frame in case.frames]
    known = np.array([reading for reading in readings if reading is not None])
    if len(known) < len(readings) or not readings:
        return np.zeros((0, 3))
    return dead_reckoning(known, case.truth[0])


def _pose(pose: Floats) -> Pose:
    return _metres(pose[0]), _metres(pose[1]), _degrees(pose[2])


def _metres(value: float) -> float:
    return round(float(value), 3)


def _degrees(radians: float) -> float:
    return round(float(np.rad2deg(radians)), 1)


def _share(value: float) -> float:
    return round(float(value), 4)
