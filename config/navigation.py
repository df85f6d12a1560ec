"""The sections of the site, as the head of every page shows them."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

from core.pages import Section

SECTIONS = (
    Section("races", "races", _("Races"), ("/races/", "/community/", "/join/", "/evaluations/")),
    Section("league", "season_now", _("League"), ("/seasons/", "/hall-of-fame/", "/cups/")),
    Section("train", "trainings", _("Train"), ("/train/",)),
    Section("learn", "learn", _("Learn"), ("/learn/",)),
    Section("tracks", "tracks", _("Tracks"), ("/tracks/",)),
    Section("garage", "models", _("Garage"), ("/models/", "/vehicles/", "/runs/", "/reports/")),
    Section("about", "about", _("How it works"), ("/about/", "/guides/")),
)
