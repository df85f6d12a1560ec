"""The ground floor's tasks, where Celery looks for them."""

from .events.tasks import follow, sweep, trim

__all__ = ["follow", "sweep", "trim"]
