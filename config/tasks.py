"""Periodic tasks of the site itself."""

from celery import shared_task
from django.contrib.sessions.models import Session

from core.api.idempotency import forget_answers
from core.database.clock import database_now
from core.personal_data.discarding import delete_discarded
from core.personal_data.retention import retain
from core.personal_data.rules import all_policies

from .operations.health import check_database_pages


@shared_task
def old_sessions() -> int:
    """Remove the sessions, the stored answers and the discarded files that are left. Returns how many sessions."""
    now = database_now()
    forget_answers(now=now)
    delete_discarded()
    return Session.objects.filter(expire_date__lt=now).delete()[0]


@shared_task
def retention() -> int:
    """Delete what has been kept for long enough. Returns how many rows were due. Beat sends it every night."""
    return sum(one.rows for one in retain(all_policies(), now=database_now()))


@shared_task
def pages() -> bool:
    """Read every page of the database. Returns whether all are whole."""
    return not check_database_pages()
