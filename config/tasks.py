"""Periodic tasks of the site itself."""

from celery import shared_task
from django.contrib.sessions.models import Session

from core.api.idempotency import forget_answers
from core.database.clock import database_now

from .operations.health import check_database_pages


@shared_task
def old_sessions() -> int:
    """Remove the sessions and the stored answers that are over. Returns how many sessions."""
    now = database_now()
    forget_answers(now=now)
    return Session.objects.filter(expire_date__lt=now).delete()[0]


@shared_task
def pages() -> bool:
    """Read every page of the database. Returns whether all are whole."""
    return not check_database_pages()
