"""The benchmark's dated report in ``docs/reports`` and the README's headline table, both from one run.

``python -m benchmarks.publish RUN`` writes them; ``make report`` runs the benchmark first.
"""

from benchmarks.publish.pages import publish
from benchmarks.publish.published import Published
from benchmarks.publish.report import report_of

__all__ = ["Published", "publish", "report_of"]
