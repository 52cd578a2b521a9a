"""What would go wrong with a map or a recording that can be read: findings, each with a place and a remedy."""

from topoloc.checks.finding import SEVERITIES, Finding, Report, Severity
from topoloc.checks.of_map import check_map
from topoloc.checks.of_recording import JUMP_M_PER_S, check_recording
from topoloc.checks.pair import check_pair

__all__ = ["JUMP_M_PER_S", "SEVERITIES", "Finding", "Report", "Severity", "check_map", "check_pair", "check_recording"]
