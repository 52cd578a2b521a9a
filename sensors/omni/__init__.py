"""Panoramas from any camera that sees all around: mirrors, fish-eye lenses and equirectangular pictures unwrapped."""

from sensors.omni.conical_mirror import ConicalMirror, conical_mirror
from sensors.omni.laws import Conical, Hyperbolic, Polynomial, RadialLaw, Spherical
from sensors.omni.pictures import Equirectangular, OmniModel, RadialPicture, from_table
from sensors.omni.unwrapper import Unwrapper, unwrapper_of

__all__ = [
    "Conical",
    "ConicalMirror",
    "Equirectangular",
    "Hyperbolic",
    "OmniModel",
    "Polynomial",
    "RadialLaw",
    "RadialPicture",
    "Spherical",
    "Unwrapper",
    "conical_mirror",
    "from_table",
    "unwrapper_of",
]
