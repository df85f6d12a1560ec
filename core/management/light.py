"""Runs a command without the apps: to load them takes longer than a short command."""

from importlib import import_module
from logging.config import dictConfig

import django
from django.apps import apps
from django.conf import settings


def run_without_apps(module: str, arguments: list[str]) -> None:
    """Run the command of ``module``. It has no models before :func:`load_apps`, and its texts are in English."""
    settings.USE_I18N = False  # translations need the apps
    dictConfig(settings.LOGGING)  # without Django's own handlers, whose mails would load its views
    import_module(module).Command().run_from_argv(arguments)


def load_apps() -> None:
    """Load the apps, unless they are loaded: for models, and for what apps register."""
    if not apps.ready:
        django.setup()
