"""Scenarios: what a robot lives through in a benchmark run, simulated from a seed or recorded by somebody."""

from benchmarks.scenarios.case import Case, Scenario
from benchmarks.scenarios.choose import DEFAULT, make_scenario, scenario_names

__all__ = ["DEFAULT", "Case", "Scenario", "make_scenario", "scenario_names"]
