"""The tables, by the names that the command line takes."""

from __future__ import annotations

from benchmarks.own_data.check import CHECK
from benchmarks.own_data.maps import MAPS
from benchmarks.own_data.panoramas_built import PANORAMAS_BUILT
from benchmarks.own_data.video import VIDEO

TABLES = {one.name: one for one in (MAPS, PANORAMAS_BUILT, VIDEO, CHECK)}
