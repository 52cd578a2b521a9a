"""The simulated laboratory under its name, for ``topoloc simulate`` and ``topoloc list worlds``."""

from __future__ import annotations

from benchmarks.worlds.simulate import LabSettings, Simulation, simulate


class LabWorld:
    """The thesis's laboratory (5.2, Figure 5.22), simulated: eight nodes on a 1 m grid in a room of 6.6 m x 6.6 m."""

    Config = LabSettings

    def __init__(self, config: LabSettings | None = None) -> None:
        self.config = config or LabSettings()

    def simulate(self, seed: int) -> Simulation:
        """A map, a drive and its truth; the same seed gives the same bytes."""
        return simulate(self.config, seed)
