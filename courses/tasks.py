"""The periodic work of courses."""

from celery import Task, shared_task

from core.database.clock import database_now

from .attempts.draws import complete_all_marks, draw_hidden_tracks, record_due_assignments


@shared_task
def deadlines() -> dict[str, int]:
    """Record which assignments are due in a day; after deadlines draw hidden tracks and complete marks."""
    now = database_now()
    due = record_due_assignments(now=now)
    return {"due": due, "drawn": draw_hidden_tracks(now=now), "completed": complete_all_marks(now=now)}


@shared_task(bind=True)
def lti_scores(self: Task) -> int:
    """Send marks that a learning platform does not have yet. Returns how many were tried."""
    from .lti.scores import queue_scores, send_scores  # where PADDOCK_LTI is set

    queue_scores(now=database_now())
    return send_scores(worker=self.request.hostname or "local")
