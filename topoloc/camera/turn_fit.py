"""The view of a camera that fits points seen before and after known turns (ours).

A turn by a known angle moves the points of a picture by a known homography, K R K^-1, so that every point tells the
focal length. A camera that does not sit on the axis of rotation is moved, too: things then shift the more the nearer
they are. How near is not known; a usual distance is assumed, and points are trusted the less the more it matters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from topoloc.camera.jackknife import jackknife
from topoloc.camera.level import View, turned
from topoloc.geometry import Floats
from topoloc.types import Ints

FIELDS_DEG = np.arange(16.0, 150.0, 2.0)
"""Fields of view that the search begins with [degrees]."""
FAR_OFF = 0.03
"""In that search a point farther off counts no more than one this far [half-widths]."""
NOISE = 0.004
"""How exactly a keypoint is found, with the shake of the camera: 1.3 pixels of 640 [half-widths]."""
AGREES = 4.0
"""A point agrees that is off by no more than so many times the noise."""
DISTANCES_SPREAD = 0.5
"""Standard deviation of the inverse distances of things, as a share of the usual one: most are 0.7 to 3 times as far
away."""


@dataclass(frozen=True)
class TurnedPoints:
    """Points seen before and after turns.

    Attributes:
        before: (M, 2) in half-widths of the picture from its middle.
        after: (M, 2).
        turn: (M,) of the camera between the two [rad, counter-clockwise].
        moved: (M, 3) how far the camera came meanwhile, in the level frame of the first [m].
        pair: (M,) which pair of frames each is of, from 0 up, without gaps.
        scene_m: usual distance of things from the camera [m].
    """

    before: Floats
    after: Floats
    turn: Floats
    moved: Floats
    pair: Ints
    scene_m: float = 3.0

    @property
    def pairs(self) -> int:
        """How many pairs of frames there are."""
        return int(self.pair.max(initial=-1)) + 1

    def scaled(self, scale: float) -> TurnedPoints:
        """The same points, turned by so many times the angles."""
        return replace(self, turn=self.turn * scale)

    def of_pairs(self, kept: NDArray[np.bool_]) -> TurnedPoints:
        """The points of some of the pairs (pairs,)."""
        chosen = kept[self.pair]
        return replace(
            self,
            before=self.before[chosen],
            after=self.after[chosen],
            turn=self.turn[chosen],
            moved=self.moved[chosen],
            pair=np.unique(self.pair[chosen], return_inverse=True)[1],
        )

    def residuals(self, view: View) -> Floats:
        """How far (M, 2) points lie from where things at the usual distance would [half-widths]."""
        return self._residuals(view, 1.0 / self.scene_m)

    def errors(self, view: View) -> Floats:
        """The same (M, 2) over what is to be expected: where the camera moved, distances are uncertain."""
        off, doubt = self._off_and_doubt(view)
        return np.asarray(off / np.hypot(NOISE, doubt)[:, None])

    def _off_and_doubt(self, view: View) -> tuple[Floats, Floats]:
        """``residuals`` (M, 2), and how uncertain distances make each of them (M,) [half-widths]."""
        usual, nearer = (self._residuals(view, share / self.scene_m) for share in (1.0, 1.0 + DISTANCES_SPREAD))
        return usual, np.linalg.norm(nearer - usual, axis=1)

    def _residuals(self, view: View, inverse_distance: float) -> Floats:
        rays = view.rays(self.before) - inverse_distance * self.moved
        return np.asarray(self.after - view.points(turned(rays, self.turn)))

    def agreeing(self, view: View) -> float:
        """Share of the points that agree with a view, however the camera nodded between two frames."""
        off, doubt = self._off_and_doubt(view)
        nods = np.array([np.median(off[self.pair == pair, 1]) for pair in range(self.pairs)])
        off[:, 1] -= nods[self.pair]
        return float((np.linalg.norm(off, axis=1) < np.hypot(AGREES * NOISE, doubt)).mean())


def searched(points: TurnedPoints) -> View:
    """The level view that fits best, of those of ``FIELDS_DEG``."""
    views = [View.of(float(field)) for field in FIELDS_DEG]
    costs = [np.minimum((points.residuals(view) ** 2).sum(axis=1) / FAR_OFF**2, 1.0).mean() for view in views]
    return views[int(np.argmin(costs))]


def fitted(points: TurnedPoints, start: View) -> View:
    """The view that fits best: least squares from a start, in which points far off count little (a Cauchy loss)."""

    def view(change: Floats) -> View:
        stretch, pitch, roll = change
        return View(start.focal * float(np.exp(stretch)), start.pitch + float(pitch), start.roll + float(roll))

    found = least_squares(lambda change: points.errors(view(change)).ravel(), np.zeros(3), loss="cauchy", x_scale=0.1)
    return view(found.x)


def spread(points: TurnedPoints, view: View) -> float:
    """Standard deviation of the field of view of a fit [degrees]: chance, and what distances leave open."""
    chance = jackknife(points.pairs, lambda kept: fitted(points.of_pairs(kept), view).hfov_deg)
    reach = np.linalg.norm(points.moved, axis=1).sum() / np.abs(points.turn).sum()
    stretch = reach * DISTANCES_SPREAD / points.scene_m
    return float(np.hypot(chance, np.sin(np.deg2rad(view.hfov_deg)) * np.rad2deg(stretch)))
