from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TracksConfig(AppConfig):
    name = "tracks"
    verbose_name = _("Tracks")

    def ready(self) -> None:
        from accounts.quotas import register
        from core.cards.registry import register_cards

        from .services import TRACKS

        register(TRACKS)
        register_cards(["tracks.drawing.cards"])
