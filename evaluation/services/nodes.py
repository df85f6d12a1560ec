"""The workers' own rows, for the operators' page."""

from __future__ import annotations

from datetime import datetime

from ..models import WorkerNode
from ..sandbox import probe as probing


def note_worker(*, name: str, now: datetime) -> WorkerNode:
    """Write down that this worker is alive and how good its sandbox is.

    Raises PlatformFault("sandbox_unavailable") after that when untrusted code may not run here.
    """
    from ..simulator.engine import ENGINE_ID

    node, _ = WorkerNode.objects.update_or_create(
        name=name[:128], defaults={"seen_at": now, "sandbox": probing.probe().to_dict(), "engine": ENGINE_ID}
    )
    probing.require()
    return node
