"""The linter's settings, with the careless application."""

from tests.lint_settings import *  # noqa: F403
from tests.lint_settings import INSTALLED_APPS

INSTALLED_APPS = [*INSTALLED_APPS, "tests.scripts.careless"]
