"""Worlds, scenarios, the runner and the report."""
