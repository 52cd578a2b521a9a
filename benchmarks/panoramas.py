"""How well panoramas are put together: ``python -m benchmarks.panoramas --write`` writes a table of docs/panoramas.md.

Simulated turns in the laboratory, seeds 0 to 4, which no setting was chosen on; and the real photographs, where they
lie beside the checkout.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.lab import LAB_PLACES, LabWorld, lab_scene
from benchmarks.worlds.snapshots import Scan, snapshots_of
from sensors.panorama import Panorama
from sensors.panorama_circle import CircleConfig, CircleReconstruction
from topoloc.cli.progress import bar
from topoloc.files import read_image, write_text
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera
from topoloc.types import Image

DOCUMENT = Path(__file__).parents[1] / "docs" / "panoramas.md"
BEGIN, END = "<!-- written by python -m benchmarks.panoramas -->\n", "<!-- end -->\n"
"""What the table stands between."""
SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"
CAMERA = Camera(40.0, 384, 288)
REPORTED_SEEDS = tuple(range(5))


@dataclass(frozen=True)
class Turns:
    """A kind of simulated turn, at each node of the laboratory.

    Attributes:
        what: for people.
        short_deg: how much the turn falls short of a circle, degrees.
        hfov_deg: field of view that the method is told; the true one is ``CAMERA``'s.
        ahead: whether the camera is where the simulated robot has it, 0.1 m ahead of the axis, or on the axis.
        effects: errors of the sensor; None are the default ones.
    """

    what: str
    short_deg: float = 0.0
    hfov_deg: float = CAMERA.hfov_deg
    ahead: bool = False
    effects: SensorEffects | None = None


@dataclass(frozen=True)
class Photographs:
    """A real turn, each of its snapshots taken as the first one.

    Attributes:
        what: for people.
        folder: below the shared data.
        hfov_deg: fields of view that the method is told.
    """

    what: str
    folder: str
    hfov_deg: tuple[float, ...]


SIMULATED = (
    Turns("complete"),
    Turns("15 degrees short", 15.0),
    Turns("20 degrees short", 20.0),
    Turns("complete, exposure varies by 25 %", effects=SensorEffects(exposure_sd=0.25)),
    Turns("complete, told 38 degrees", hfov_deg=38.0),
    Turns("complete, told 42 degrees", hfov_deg=42.0),
    Turns("complete, camera 0.1 m ahead of the axis", ahead=True),
    Turns("15 degrees short, camera 0.1 m ahead of the axis", 15.0, ahead=True),
)
REAL = (
    Photographs("office ring, six cameras, 40 degrees wide", "ring6_lab", (38.0, 39.0, 40.0, 41.0, 42.0)),
    Photographs("courtyard, hand-held, about 65 degrees wide", "rotation_courtyard", (62.0, 64.0, 65.0, 66.0, 68.0)),
)


def worst_deg(made: Panorama, clockwise_deg: Floats) -> float:
    """Largest error of a heading beside the first one's, which is given [degrees].

    Args:
        made: the panorama.
        clockwise_deg: (S,) true angle of each snapshot [degrees].
    """
    turned = np.deg2rad(clockwise_deg - clockwise_deg[0])
    return float(np.rad2deg(np.abs(wrap(made.headings - made.headings[0] + turned))).max())


def simulated_turn(turns: Turns, seed: int, place: int) -> tuple[list[Image], Floats]:
    """Snapshots of the simulated laboratory, and how far each lies clockwise of the first (S,) [degrees]."""
    position = np.array([LAB_PLACES[place].x, LAB_PLACES[place].y])
    mount = LabWorld().mount if turns.ahead else None
    rng = np.random.default_rng([seed, place])
    taken = snapshots_of(lab_scene(seed), position, CAMERA, rng, mount, Scan(short_deg=turns.short_deg), turns.effects)
    turned, pictures = zip(*taken, strict=True)
    return list(pictures), np.rad2deg(turned)


def of_simulated(turns: Turns, seeds: Sequence[int] = REPORTED_SEEDS) -> Iterator[float]:
    """The worst snapshot of each turn [degrees]: every node of every seed."""
    method = CircleReconstruction(CircleConfig(hfov_deg=turns.hfov_deg))
    for seed in seeds:
        for place in range(len(LAB_PLACES)):
            pictures, clockwise_deg = simulated_turn(turns, seed, place)
            yield worst_deg(method.reconstruct(pictures), clockwise_deg)


def of_photographs(folder: Path, hfov_deg: float) -> Iterator[float]:
    """The worst snapshot of a real turn [degrees], for each of its snapshots as the first one.

    Args:
        folder: of the snapshots and ``yaws.csv``.
        hfov_deg: field of view that the method is told, degrees.
    """
    with (folder / "yaws.csv").open(newline="") as file:
        yaws = {row["file"]: float(row["yaw_deg_ccw"]) for row in csv.DictReader(file)}
    pictures, clockwise_deg = [read_image(folder / name) for name in yaws], -np.array(list(yaws.values()))
    method = CircleReconstruction(CircleConfig(hfov_deg=hfov_deg))
    for start in range(len(pictures)):
        made = method.reconstruct(pictures[start:] + pictures[:start])
        yield worst_deg(made, np.roll(clockwise_deg, -start))


def rows() -> Iterator[tuple[str, Floats]]:
    """What was turned, and the worst snapshot of each turn (T,) [degrees]; real ones only where they are there."""
    for photographs in REAL:
        folder = SHARED_DATA / photographs.folder / "snapshots"
        for told in photographs.hfov_deg if folder.is_dir() else ():
            yield f"real {photographs.what}; told {told:g}", np.array(list(of_photographs(folder, told)))
    for turns in SIMULATED:
        yield f"simulated, {turns.what}", np.array(list(of_simulated(turns)))


def table(measured: Sequence[tuple[str, Floats]]) -> str:
    """A table in Markdown: the worst snapshot of a turn, over turns."""
    lines = ["| turns | number | median | 95 % below | worst |", "|---|---|---|---|---|"]
    for what, worst in measured:
        figures = (np.median(worst), np.quantile(worst, 0.95), worst.max())
        lines.append(f"| {what} | {len(worst)} | {' | '.join(f'{figure:.2f}' for figure in figures)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and print the table; with --write, put it into the document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{DOCUMENT.name}")
    words = parser.parse_args()
    real = sum(
        len(one.hfov_deg) for one in REAL if (SHARED_DATA / one.folder / "snapshots").is_dir()
    )  # elsewhere their rows would vanish from the document
    if words.write and real == 0:
        parser.error(f"{SHARED_DATA} is not there; the document's table has the real photographs too")
    with threadpool_limits(1), bar() as progress:
        measured = list(progress.track(rows(), total=real + len(SIMULATED), description="measuring turns"))
    print(table(measured))
    if words.write:
        text = DOCUMENT.read_text(encoding="utf-8")
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        write_text(DOCUMENT, before + BEGIN + table(measured) + END + after)


if __name__ == "__main__":
    main()
