"""Building a map from a recorded drive: nodes, panoramas, edges and training views."""

from topoloc.mapping.building.builder import Built, build_map
from topoloc.mapping.building.config import BuildConfig
from topoloc.mapping.building.turns import Turn, turns_on_the_spot
from topoloc.mapping.building.way import Way, way_of

__all__ = ["BuildConfig", "Built", "Turn", "Way", "build_map", "turns_on_the_spot", "way_of"]
