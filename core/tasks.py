"""The ground floor's tasks, in the module that Celery searches."""

from .events.tasks import follow, sweep, trim

__all__ = ["follow", "sweep", "trim"]
