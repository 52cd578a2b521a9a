"""A report as people and programs read it."""

from __future__ import annotations

import json

import numpy as np

from topoloc.live.report import LiveCounts, LiveReport
from topoloc.topo_map import TopoMap


def as_json(report: LiveReport, topo_map: TopoMap) -> str:
    """One line of JSON: place, pose, how sure, and what became of the messages so far."""
    x, y, theta = report.estimate.pose.tolist()
    counts = report.counts
    told = {
        "timestamp": round(report.timestamp, 6),
        "status": report.status.value,
        "why": report.why,
        "node": report.node_id,
        "name": _name(report, topo_map),
        "x": round(x, 4),
        "y": round(y, 4),
        "heading_deg": round(float(np.rad2deg(theta)), 2),
        "covariance": np.round(report.estimate.covariance, 9).tolist(),
        "probability": round(report.estimate.probability, 6),
        "latency_s": round(report.latency_s, 4),
        "counts": {name: getattr(counts, name) for name in counts.__dataclass_fields__},
    }
    return json.dumps(told, ensure_ascii=False)


def as_line(report: LiveReport, topo_map: TopoMap) -> str:
    """One line for people."""
    x, y, theta = report.estimate.pose.tolist()
    place = "-" if report.node_id is None else f"{report.node_id} {_name(report, topo_map) or ''}".strip()
    counts = report.counts
    words = [
        f"{report.status.value:<9}",
        place,
        f"x {x:.2f} y {y:.2f} heading {np.rad2deg(theta):.0f}",
        f"p {report.estimate.probability:.2f}",
        f"dropped {counts.dropped}/{counts.frames}",
        report.why,
        f"at {report.timestamp:.2f} s",  # last, where a narrow terminal cuts
    ]
    return "  ".join(word for word in words if word)


def _name(report: LiveReport, topo_map: TopoMap) -> str | None:
    return None if report.estimate.node is None else topo_map.nodes[report.estimate.node].name


def summary(counts: LiveCounts) -> str:
    """What became of the messages, and what to do where many were dropped."""
    told = {
        "dropped": counts.dropped,
        "passed over": counts.skipped,
        "late": counts.late,
        "unreadable": counts.unreadable,
        "bad messages": counts.bad,
        "breaks of the odometry": counts.jumps,
        "new starts": counts.restarts,
    }
    words = "".join(f", {count} {name}" for name, count in told.items() if count)
    slow = (
        "; too slow for all: take a faster sensor, or even it out with --rate" if counts.dropped > counts.used else ""
    )
    return f"{counts.frames} pictures: {counts.used} used{words}{slow}"
