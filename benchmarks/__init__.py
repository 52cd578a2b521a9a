"""Worlds, scenarios, the runner, metrics and the report."""
