"""The site's own periodic work."""

from __future__ import annotations

from celery import shared_task
from django.contrib.sessions.models import Session
from django.utils import timezone

from .pages import look_at_pages


@shared_task
def old_sessions() -> int:
    """Remove the sessions that are over. Returns how many."""
    return Session.objects.filter(expire_date__lt=timezone.now()).delete()[0]


@shared_task
def pages() -> bool:
    """Read every page of the database. Returns whether all are whole."""
    return not look_at_pages()
