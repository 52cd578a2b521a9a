"""The conical mirror of the thesis's appendix C: its dimensions from what it shall see of the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sensors.omni.laws import Conical


@dataclass(frozen=True)
class ConicalMirror:
    """A cone with its tip towards the camera; the symbols are those of Figures C.1 and C.2.

    Attributes:
        gamma_deg: gamma, between the cone's surface and its base, degrees.
        beta_deg: beta, between the camera's axis and its ray to the rim, degrees.
        tip_m: l, from the camera to the tip [m].
        cone_m: h, from the tip to the plane of the rim [m].
        rim_m: r, radius of the rim [m].
    """

    gamma_deg: float
    beta_deg: float
    tip_m: float
    cone_m: float
    rim_m: float

    def law(self, rim_px: float, scene_m: float = math.inf) -> Conical:
        """The radial law of a camera that sees this mirror; the rim in its picture tells its focal length.

        Args:
            rim_px: radius of the rim in the picture [pixels].
            scene_m: see ``Conical``.
        """
        focal_px = rim_px / math.tan(math.radians(self.beta_deg))
        rim = rim_px * (1.0 + 1e-9)  # the rim itself is seen, whatever the rounding
        return Conical(focal_px=focal_px, rim_px=rim, gamma_deg=self.gamma_deg, tip_m=self.tip_m, scene_m=scene_m)


def conical_mirror(
    near_m: float,
    height_m: float,
    far_m: float,
    *,
    tip_m: float | None = None,
    cone_m: float | None = None,
    rim_m: float | None = None,
) -> ConicalMirror:
    """Dimensions of a cone that shows the floor from ``near_m`` to ``far_m``: thesis C.2, (C.1) to (C.3).

    What is reflected at the tip comes from the near end, what is reflected at the rim from the far one. The thesis
    neglects r and h beside H; seen exactly, with H the height of the tip, the far end lies r + D h / H farther away.
    Give one of the last three; it sets the scale of all.

    Args:
        near_m: d, from the axis to the nearest floor that is seen [m].
        height_m: H, of the mirror above the floor [m].
        far_m: D, from the axis to the farthest floor that is seen [m]; infinite for the horizon.
        tip_m: l, from the camera to the tip [m].
        cone_m: h, height of the cone [m].
        rim_m: r, radius of the rim [m].

    Raises:
        ValueError: a length that is not above 0, D not above d, or not just one of l, h and r.
    """
    given = [value for value in (tip_m, cone_m, rim_m) if value is not None]
    if len(given) != 1:
        raise ValueError(f"{len(given)} of tip_m, cone_m and rim_m are given; give one, it sets the scale")
    if not (height_m > 0.0 and far_m > near_m > 0.0 and given[0] > 0.0):
        raise ValueError("all lengths must be above 0, and far_m above near_m")
    gamma = math.atan(near_m / height_m) / 2.0  # (C.1), whose printed form has lost its brackets
    beta = math.atan(far_m / height_m) - 2.0 * gamma  # (C.2)
    tips_per_cone = 1.0 / (math.tan(beta) * math.tan(gamma)) - 1.0  # (C.3)
    if tip_m is not None:
        cone_m = tip_m / tips_per_cone
    elif rim_m is not None:
        cone_m = rim_m * math.tan(gamma)  # "note also that h = r tan gamma"
    assert cone_m is not None
    return ConicalMirror(
        gamma_deg=math.degrees(gamma),
        beta_deg=math.degrees(beta),
        tip_m=cone_m * tips_per_cone,
        cone_m=cone_m,
        rim_m=cone_m / math.tan(gamma),
    )
