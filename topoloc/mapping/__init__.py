"""Maps from images alone: a layout by springs, and Procrustes to compare it with the truth (third seed, section 3)."""

from topoloc.mapping.layout import METHODS, LayoutConfig, LayoutStep, batch, incremental, laid_out
from topoloc.mapping.lengths import chained
from topoloc.mapping.procrustes import Similarity, onto, shape_error
from topoloc.mapping.springs import Springs
from topoloc.mapping.stiffness import LAWS, stiffness_of

__all__ = [
    "LAWS",
    "METHODS",
    "LayoutConfig",
    "LayoutStep",
    "Similarity",
    "Springs",
    "batch",
    "chained",
    "incremental",
    "laid_out",
    "onto",
    "shape_error",
    "stiffness_of",
]
