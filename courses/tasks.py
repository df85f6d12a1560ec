"""The periodic work of courses."""

from celery import shared_task

from core.database.clock import database_now

from .attempts.draws import complete_all_marks, draw_hidden_tracks


@shared_task
def deadlines() -> dict[str, int]:
    """Draw the hidden tracks of assignments that are due, and complete the marks of those that are over."""
    now = database_now()
    return {"drawn": draw_hidden_tracks(now=now), "completed": complete_all_marks(now=now)}
