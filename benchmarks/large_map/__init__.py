"""A map of up to 10,000 nodes from many simulated buildings, and what IMA's coarse stage gains and costs on it.

``python -m benchmarks.large_map make --nodes 10000 --seed 1 -o DIR`` makes it, ``measure DIR`` measures. Settings of
the coarse stage are chosen on the map of seed 1000; what is reported is of the map of seed 1.
"""

from __future__ import annotations

from benchmarks.large_map.making import LargeMap, make_large_map

__all__ = ["LargeMap", "make_large_map"]
