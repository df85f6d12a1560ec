"""The app of the site: it registers the sections of the head of every page and what the menu of staff shows."""

from typing import Any

from django.apps import AppConfig
from django.core.management.base import CommandError
from django.db import connections
from django.db.models.signals import pre_migrate
from django.utils.translation import gettext_lazy as _

from core.pages.registry import Section, register_sections, register_slots

SECTIONS = (
    Section("races", "races", _("Races"), ("/races/", "/community/", "/join/", "/evaluations/")),
    Section("league", "season_now", _("League"), ("/seasons/", "/hall-of-fame/", "/cups/")),
    Section("train", "trainings", _("Train"), ("/train/",)),
    Section("learn", "learn", _("Learn"), ("/learn/",)),
    Section("tracks", "tracks", _("Tracks"), ("/tracks/",)),
    Section("garage", "models", _("Garage"), ("/models/", "/vehicles/", "/runs/", "/reports/")),
    Section("about", "about", _("How it works"), ("/about/", "/guides/")),
)


class ConfigConfig(AppConfig):
    name = "config"

    def ready(self) -> None:
        pre_migrate.connect(refuse_unreleased_database, dispatch_uid="config.refuse_unreleased_database")
        register_sections(SECTIONS)
        register_slots({"menu.staff": "config/parts/menu.html"})


def refuse_unreleased_database(using: str, **kwargs: Any) -> None:
    """Raise CommandError for a database from before 0.1.0: its migrations have the names of other ones."""
    if "league_racer" in connections[using].introspection.table_names():
        raise CommandError(
            "This database is from a version before 0.1.0, which cannot be upgraded. Nothing was changed."
        )
