"""``topoloc map layout``: a layout from image distances alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from topoloc.geometry import Floats
    from topoloc.mapping import LayoutConfig, LayoutStep
    from topoloc.types import Image, Ints

OUTPUTS = ("layout.csv", "layout.png")
FEWEST_IMAGES = 3
"""Two images have one distance, and no layout."""


def layout(
    source: Annotated[Path, Parameter(help="Map with panoramas, or a folder of panorama pictures in file order.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Folder to make.")],
    sensor: Annotated[str, Parameter(help="That compares images with each other.")] = "fourier",
    method: Annotated[Literal["batch", "incremental"], Parameter(help="All images at once, or one by one.")] = (
        "incremental"
    ),
    stiffness: Annotated[
        Literal["constant", "inverse", "inverse-square", "linear", "exponential"],
        Parameter(help="Of a spring, by the distance of its images."),
    ] = "constant",
    settings: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set", help="sensor.KEY=VALUE, see 'topoloc list sensors', or layout.KEY=VALUE, as told above."
        ),
    ] = (),
    seed: Annotated[int, Parameter(help="Of where images start.", validator=Number(gte=0))] = 0,
    spacing_m: Annotated[
        float | None,
        Parameter(help="Mean distance between images that follow each other, metres.", validator=Number(gt=0)),
    ] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the files of an earlier layout.", negative="")] = False,
) -> None:
    """Lay out panoramas as they were taken, from how alike they look and nothing else.

    Pictures of a folder are taken for full circles; ``topoloc unwrap`` makes them of an omnidirectional camera's.

    Writes ``layout.csv`` (image, x, y) and ``layout.png``. Images cannot tell scale, turn and reflection: 1 is the mean
    distance between images that follow each other, unless ``--spacing-m`` tells it. Where the source is a map, the
    positions of its nodes serve for the comparison at the end only.

    Settings of the layout: ``neighbours=3`` nearest images that each is joined with, distances being summed along
    chains of them (0: the image distances themselves), ``reach=2`` of linear and exponential stiffness, in median
    distances, ``iterations=1000``, ``iterations_each=30``, ``tolerance=0.001``, ``damping=1``, ``step=0.5``,
    ``beside=0.1``.

    Example: ``topoloc map layout lab/map -o layout --set sensor.components=8 --set layout.neighbours=4``
    """
    from topoloc import plugins
    from topoloc.errors import UserError
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.mapping import LayoutConfig
    from topoloc.settings import build, parse_words, refuse_unknown

    refuse_to_overwrite(output, overwrite)
    tables = parse_words(settings)
    refuse_unknown(tables, {"sensor", "layout"}, "--set")
    told = tables.get("layout", {})
    if "stiffness" in told:
        raise UserError("--set layout.stiffness: this one has an option of its own; write --stiffness NAME")
    config = build(LayoutConfig, {**told, "stiffness": stiffness}, "settings of layout")
    eye = plugins.make_sensor(sensor, tables.get("sensor"))
    places = _read(source)
    with new_folder(output, overwrite, owned=OUTPUTS) as folder:
        distances = _distances(eye, sensor, places)
        last = _laid_out(method, distances, config, seed)
        fit = _write(folder, places, last, spacing_m, f"{method}, {stiffness}")
    _report(output, last, fit, spacing_m)


@dataclass(frozen=True)
class _Places:
    """What is laid out: names and images in the order of capture, lines between them, and where they are, if known."""

    names: Sequence[str]
    images: Sequence[Image]
    edges: Ints
    truth: Floats | None = None


def _read(source: Path) -> _Places:
    """The panoramas of a map, or the pictures of a folder. Raises ``InputError`` where they are too few."""
    from topoloc.errors import InputError
    from topoloc.map_folder import MAP_FILE

    is_map = source.is_file() or (source / MAP_FILE).exists()
    places = _read_map(source) if is_map else _read_pictures(source)
    if len(places.images) < FEWEST_IMAGES:
        problem = f"holds {len(places.images)} panoramas"
        raise InputError(source, problem, f"a layout needs {FEWEST_IMAGES} or more; name a map or a folder of them")
    return places


def _read_map(source: Path) -> _Places:
    import numpy as np

    from topoloc.topo_map import TopoMap

    the_map = TopoMap.load(source)
    having = [number for number, node in enumerate(the_map.nodes) if node.has_panorama]
    images = [panorama for node in the_map.nodes if (panorama := node.panorama) is not None]
    rank = {number: place for place, number in enumerate(having)}
    edges = [(rank[a], rank[b]) for a, b in np.asarray(the_map.edges).tolist() if a in rank and b in rank]
    truth = the_map.positions[having]
    ids = [the_map.nodes[number].id for number in having]
    spread = bool(len(truth) and np.ptp(truth, axis=0).max() > 0.0)
    return _Places(ids, images, np.array(edges, dtype=np.int64).reshape(-1, 2), truth if spread else None)


def _read_pictures(folder: Path) -> _Places:
    import numpy as np

    from topoloc.errors import InputError
    from topoloc.files import pictures_in, read_image

    if not folder.is_dir():
        raise InputError(folder, "no such folder", "name a map or a folder of panorama pictures")
    files = pictures_in(folder)
    number = np.arange(len(files))
    edges = np.column_stack([number[:-1], number[1:]])
    images = [read_image(file) for file in files]
    for file, image in zip(files, images, strict=True):
        if image.shape[:2] != images[0].shape[:2]:
            sizes = [f"{one.shape[1]}x{one.shape[0]}" for one in (images[0], image)]
            problem = f"sizes differ: {files[0].name} is {sizes[0]}, {file.name} is {sizes[1]}"
            raise InputError(folder, problem, "lay out panoramas of one camera")
    return _Places([file.name for file in files], images, edges)


def _distances(eye: Any, name: str, places: _Places) -> Floats:
    """Distances (N, N) between the images. Raises ``UserError`` for a sensor that has none, or none but 0."""
    import numpy as np
    from rich.console import Console

    from topoloc.errors import UserError
    from topoloc.interfaces import ImageComparison

    if not isinstance(eye, ImageComparison):
        raise UserError(f"{name} compares no images with each other; take a sensor that does, such as fourier")
    with Console(stderr=True).status("comparing images"):
        distances = np.array(eye.distances_between(places.images), dtype=np.float64)
    np.fill_diagonal(distances, 0.0)  # rounding leaves a little
    first = places.images[0]
    if not distances.any() or all(np.array_equal(image, first) for image in places.images):
        raise UserError(f"all {len(distances)} images look the same to {name}; take pictures of different places")
    return distances


def _laid_out(method: str, distances: Floats, config: LayoutConfig, seed: int) -> LayoutStep:
    """The last step of a method, with a progress bar: over iterations (batch) or images."""
    import numpy as np

    from topoloc.cli.progress import bar
    from topoloc.errors import UserError
    from topoloc.mapping import METHODS

    steps = METHODS[method](distances, config, np.random.default_rng(seed))
    with bar() as progress:
        total = config.iterations + 1 if method == "batch" else len(distances)
        *_, last = progress.track(steps, total=total, description="laying out")
    if not np.isfinite(last.positions).all():
        raise UserError("the springs flew apart; take a smaller --set layout.step, or another --stiffness")
    return last


def _write(folder: Path, places: _Places, last: LayoutStep, spacing_m: float | None, title: str) -> float | None:
    """Write both files; returns Procrustes mu where the truth is known."""
    import numpy as np

    from topoloc.files import write_bytes, write_csv
    from topoloc.mapping import onto, shape_error
    from topoloc.mapping.picture import draw_layout
    from topoloc.plan import as_png

    between = np.linalg.norm(np.diff(last.positions, axis=0), axis=1).mean()
    positions = (last.positions - last.positions.mean(axis=0)) * (spacing_m or 1.0) / between
    rows = [(name, f"{x:.6g}", f"{y:.6g}") for name, (x, y) in zip(places.names, positions, strict=True)]
    write_csv(folder / "layout.csv", ("image", "x", "y"), rows)
    if places.truth is None:
        fit, unit = None, "mean distance of successive images" if spacing_m is None else "m"
        figure = draw_layout(positions, None, places.edges, unit, title)
    else:
        fit = shape_error(places.truth, positions)
        moved = onto(places.truth, positions).apply(positions)
        figure = draw_layout(moved, places.truth, places.edges, "m", f"{title}: put onto the truth, mu = {fit:.3f}")
    write_bytes(folder / "layout.png", as_png(figure))
    return fit


def _report(output: Path, last: LayoutStep, fit: float | None, spacing_m: float | None) -> None:
    import sys

    print(f"{len(last.positions)} images, {last.iterations} iterations")
    if fit is not None:
        print(f"Procrustes mu {fit:.4f}: 0 is the shape of the map, 1 nothing of it")
    if spacing_m is None:
        print("no known scale: 1 is the mean distance between images that follow each other; --spacing-m tells it")
    if not last.rests:
        print("warning: not at rest yet; more with --set layout.iterations=5000", file=sys.stderr)
    print(f"{output}: {', '.join(OUTPUTS)}")
