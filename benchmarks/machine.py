"""What a benchmark ran on."""

from __future__ import annotations

import os
import sys
from typing import Any

from paddock.simulator.engine import ENGINE_ID, cpu_model, versions


def measured_on(load_before: float) -> dict[str, Any]:
    """Processor, cores, load (of the last minute, before and now), Python, engine and libraries, as JSON values."""
    return {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)),
        "load_before": round(load_before, 2),
        "load_after": round(os.getloadavg()[0], 2),
        "python": sys.version.split()[0],
        "engine": ENGINE_ID,
        "versions": versions(),
    }
