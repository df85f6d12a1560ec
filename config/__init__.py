"""The Django project."""

from .celery import app as celery_app

__all__ = ["celery_app"]

from . import reasons as reasons  # registers its codes
