from django.apps import AppConfig
from django.db.models.signals import pre_migrate


class ConfigConfig(AppConfig):
    name = "config"

    def ready(self) -> None:
        from core.pages import register_sections, register_slots

        from .carry_over import refuse_what_is_from_before
        from .navigation import SECTIONS

        pre_migrate.connect(refuse_what_is_from_before, dispatch_uid="config.refuse_what_is_from_before")
        register_sections(SECTIONS)
        register_slots({"menu.staff": "config/parts/menu.html"})
