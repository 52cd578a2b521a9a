"""Where in an omnidirectional picture a heading and an elevation are seen, and the ``[omni]`` table that tells it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, Protocol

import numpy as np

from sensors.omni.laws import Conical, Hyperbolic, Polynomial, RadialLaw, Spherical
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.settings import build, refuse_unknown

LAWS: dict[str, type[Conical | Hyperbolic | Spherical | Polynomial]] = {
    "conical": Conical,
    "hyperbolic": Hyperbolic,
    "spherical": Spherical,
    "polynomial": Polynomial,
}
EQUIRECTANGULAR = "equirectangular"


class OmniModel(Protocol):
    """An omnidirectional camera; a class with this method is all that ``Unwrapper`` needs."""

    def locate(self, headings: Floats, elevations: Floats, width: int, height: int) -> tuple[Floats, Floats]:
        """Where directions are seen in a picture of ``width`` x ``height``.

        Args:
            headings: [rad, ccw] in the camera's frame, 0 = its heading; broadcasts with the next.
            elevations: [rad] above the horizon.
            width: of the picture [pixels].
            height: alike.

        Returns:
            x and y [pixels] from the picture's left and upper edge, 0.5 in the middle of the first pixel; nan where
            the direction is not seen.
        """


@dataclass(frozen=True, kw_only=True)
class RadialPicture:
    """A picture that shows the headings around a centre: of a mirror or a fish-eye lens, its axis upright.

    A camera that looks up sees counter-clockwise headings clockwise in its picture, one that looks down as they are.

    Attributes:
        law: how elevations lie along a radius.
        center_x, center_y: the axis in the picture [pixels] from its left and upper edge.
        top_deg: heading that is seen straight above the centre, degrees counter-clockwise from the camera's.
        looks: ``up``, at a mirror that hangs above it or with a fish-eye lens, or ``down``.
    """

    law: RadialLaw
    center_x: float
    center_y: float
    top_deg: float = 0.0
    looks: Literal["up", "down"] = "up"

    def locate(self, headings: Floats, elevations: Floats, width: int, height: int) -> tuple[Floats, Floats]:
        """See ``OmniModel``."""
        up = 1.0 if self.looks == "up" else -1.0
        clockwise = up * (headings - np.deg2rad(self.top_deg))  # in the picture, from straight above the centre
        radius = self.law.radius(up * elevations)
        x, y = self.center_x + radius * np.sin(clockwise), self.center_y - radius * np.cos(clockwise)
        inside = (x >= 0.5) & (x <= width - 0.5) & (y >= 0.5) & (y <= height - 0.5)
        return np.where(inside, x, np.nan), np.where(inside, y, np.nan)


@dataclass(frozen=True, kw_only=True)
class Equirectangular:
    """A picture linear in heading and elevation, a full circle wide, as 360-degree cameras give it.

    Attributes:
        left_deg: heading of the left edge, degrees counter-clockwise from the camera's; the picture runs clockwise.
            By default its middle looks ahead.
        upper_deg: elevation of the upper edge, degrees.
        lower_deg: elevation of the lower edge, degrees.
    """

    left_deg: float = 180.0
    upper_deg: float = 90.0
    lower_deg: float = -90.0

    def __post_init__(self) -> None:
        if not -90.0 <= self.lower_deg < self.upper_deg <= 90.0:
            raise ValueError(
                f"lower_deg is {self.lower_deg} and upper_deg {self.upper_deg}; they must grow within -90 and 90"
            )

    def locate(self, headings: Floats, elevations: Floats, width: int, height: int) -> tuple[Floats, Floats]:
        """See ``OmniModel``."""
        x = (np.deg2rad(self.left_deg) - headings) / (2.0 * np.pi) % 1.0 * width
        upper, lower = np.deg2rad(self.upper_deg), np.deg2rad(self.lower_deg)
        y = (upper - elevations) / (upper - lower) * height
        row = np.where((y >= 0.0) & (y <= height), np.clip(y, 0.5, height - 0.5), np.nan)
        return np.where(np.isnan(row), np.nan, x), np.broadcast_to(row, np.broadcast_shapes(x.shape, row.shape))


def from_table(table: Mapping[str, Any], where: str = "[omni]") -> OmniModel:
    """The model that an ``[omni]`` table of ``camera.toml`` tells.

    Args:
        table: ``model``, one of ``LAWS`` or ``equirectangular``, and the model's settings; for a law's model those of
            ``RadialPicture`` among them.
        where: what errors call the table.

    Raises:
        UserError: an unknown model or key, a missing key, or a value that does not suit.
    """
    settings = {key: value for key, value in table.items() if key != "model"}
    model, known = table.get("model"), [*LAWS, EQUIRECTANGULAR]
    if model not in known:
        raise UserError(f"{where}: model is {model!r}; choose from: {', '.join(known)}")
    if model == EQUIRECTANGULAR:
        return build(Equirectangular, settings, where)
    law = LAWS[model]
    of_law = {item.name for item in fields(law)}
    of_picture = {item.name for item in fields(RadialPicture)} - {"law"}
    refuse_unknown(settings, of_law | of_picture, where)
    for item in (*fields(law), *fields(RadialPicture)):
        if item.name != "law" and item.default is MISSING and item.name not in settings:
            raise UserError(f"{where}: {item.name} is missing; a {model} model needs it, see docs/omni.md")
    made = build(law, {key: value for key, value in settings.items() if key in of_law}, where)
    picture = {key: value for key, value in settings.items() if key in of_picture}
    return build(RadialPicture, {**picture, "law": made}, where)
