"""The Django project, and the league itself: racers, seasons, rounds."""

from .celery import app as celery_app

__all__ = ["celery_app"]
