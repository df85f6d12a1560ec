"""The workers' own rows, for the operators' page."""

from __future__ import annotations

from datetime import datetime

from ..models import WorkerNode
from ..sandbox import probe as probing


def note_worker(*, name: str, now: datetime, sandboxed: bool = True) -> WorkerNode:
    """Write down that this worker is alive and how good its sandbox is.

    Raises PlatformFault("sandbox_unavailable") after that when untrusted code may not run here. ``sandboxed=False``: it
    runs no such code, and is not asked.
    """
    from ..simulator.engine import ENGINE_ID

    sandbox = probing.probe().to_dict() if sandboxed else {}
    node, _ = WorkerNode.objects.update_or_create(
        name=name[:128], defaults={"seen_at": now, "sandbox": sandbox, "engine": ENGINE_ID}
    )
    if sandboxed:
        probing.require()
    return node
