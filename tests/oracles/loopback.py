"""CycloneDDS on the loopback interface alone, in a domain of this process's own, and waiting for what is sent there."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

LOOPBACK = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>9</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""For the variable CYCLONEDDS_URI."""
DOMAIN = 10 + os.getpid() % 90
NAME = f"robot_{os.getpid()}"
"""Of the robot's topics, in case another process has the same domain."""
DEADLINE_S = 30.0
"""Waiting longer than this is a failure; no test looks at the clock otherwise."""


def until(true: Callable[[], Any], told: Callable[[], str] = str) -> Any:
    """Wait for a value that is true, and return it; a failure says what was told meanwhile."""
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        if value := true():
            return value
        time.sleep(0.005)
    raise AssertionError(f"it never came; {told()}")
