"""``camera.toml``: what the camera of a recording is, how it sits on the robot, and how its lens bends the picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from topoloc.errors import InputError
from topoloc.files import write_text
from topoloc.lens import Lens
from topoloc.settings import build, convert, optional_length, read_toml, refuse_unknown
from topoloc.topo_map import Camera

TruthOf = Literal["robot", "optical"]
"""Whose poses ``groundtruth.txt`` has: the robot's axis, or the camera's optical frame (z forward, y down)."""


@dataclass(frozen=True)
class Mount:
    """Where the camera sits on the robot: x, y [m], yaw_deg degrees counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    yaw_deg: float = 0.0


@dataclass(frozen=True)
class Rig:
    """What ``camera.toml`` tells; the fields are those of ``topoloc.recording.Recording``.

    Attributes:
        camera: the pinhole camera that the pictures are of once they are straightened.
        mount: of the camera on the robot, without pan.
        baseline_m: distance of the right camera from the main one, to its right [m].
        panorama: the ``omni`` pictures are unwrapped.
        omni: the table ``[omni]``.
        lens: how the recorded ``rgb`` and ``depth`` pictures are bent; None: not at all.
        groundtruth_of: whose poses ``groundtruth.txt`` has; None: to be recognised from its quaternions.
    """

    camera: Camera | None = None
    mount: Mount = field(default_factory=Mount)
    baseline_m: float | None = None
    panorama: bool = False
    omni: Mapping[str, Any] | None = None
    lens: Lens | None = None
    groundtruth_of: TruthOf | None = None


def read_rig(path: Path) -> Rig:
    """What a ``camera.toml`` tells; nothing where it does not exist. Raises ``UserError`` naming the key."""
    if not path.exists():
        return Rig()
    table = read_toml(path, "restore it")
    of_camera = {item.name for item in fields(Camera)}
    refuse_unknown(table, of_camera | {item.name for item in fields(Rig)} - {"camera"}, path)
    lens = build(Lens, _whole_lens(table["lens"], path), f"{path} [lens]") if "lens" in table else None
    truth_of = table.get("groundtruth_of")
    rig = Rig(
        camera=_camera({key: table[key] for key in of_camera & set(table)}, lens, path),
        mount=build(Mount, table.get("mount", {}), f"{path} [mount]"),
        baseline_m=optional_length(table, "baseline_m", path),
        panorama=convert(table.get("panorama", False), bool, f"{path}: panorama"),
        omni=_omni_table(table["omni"], path) if "omni" in table else None,
        lens=lens,
        groundtruth_of=None if truth_of is None else convert(truth_of, TruthOf, f"{path}: groundtruth_of"),
    )
    if rig.panorama and rig.omni is not None:
        raise InputError(
            path, "panorama = true says unwrapped, [omni] how to unwrap", "take out the one that does not hold"
        )
    return rig


def _whole_lens(table: Any, path: Path) -> Any:
    """The table ``[lens]``; ``InputError`` names what it lacks."""
    needed = ("model", "fx", "fy", "cx", "cy")
    missing = [key for key in needed if isinstance(table, Mapping) and key not in table]
    if missing:
        remedy = "write model (pinhole or fisheye), fx, fy, cx, cy; 'topoloc camera chessboard' finds them"
        raise InputError(path, f"[lens] lacks {', '.join(missing)}", remedy)
    return table


def _camera(table: Mapping[str, Any], lens: Lens | None, path: Path) -> Camera | None:
    """The pinhole camera, or None where no field of view is told; with a lens it is the lens's by default."""
    if lens is None:
        return build(Camera, table, path) if "hfov_deg" in table else None
    for key in ("width", "height"):
        if key not in table:
            raise InputError(path, f"[lens] is told, but no {key}", "write the size of the pictures, in pixels")
    width = convert(table["width"], int, f"{path}: width")
    return build(Camera, {"hfov_deg": lens.hfov_deg(width), **table}, path)


def _omni_table(table: Any, path: Path) -> Mapping[str, Any]:
    """The table ``[omni]``, held to what any model's settings are made of; the model itself is of another room."""
    if not isinstance(table, Mapping) or not isinstance(table.get("model"), str):
        raise InputError(path, "[omni] names no model", 'write [omni] and below it model = "conical" or another')
    for key, value in table.items():
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, str):
                convert(item, float, f"{path} [omni]: {key}")
    return table


def write_rig(path: Path, rig: Rig) -> None:
    """Write a ``camera.toml``, whole; ``read_rig`` reads it back. What is not known is left out."""
    import tomli_w

    table: dict[str, Any] = {} if rig.camera is None else asdict(rig.camera)
    told = {"baseline_m": rig.baseline_m, "groundtruth_of": rig.groundtruth_of, "panorama": rig.panorama or None}
    table |= {key: value for key, value in told.items() if value is not None}
    if rig.mount != Mount():
        table["mount"] = asdict(rig.mount)
    if rig.lens is not None:
        table["lens"] = {**asdict(rig.lens), "coefficients": list(rig.lens.coefficients)}
    if rig.omni is not None:
        table["omni"] = dict(rig.omni)
    write_text(path, tomli_w.dumps(table))
