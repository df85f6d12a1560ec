from django.apps import AppConfig
from django.db.models.signals import pre_migrate


class ConfigConfig(AppConfig):
    name = "config"

    def ready(self) -> None:
        from .carry_over import refuse_what_is_from_before

        pre_migrate.connect(refuse_what_is_from_before, dispatch_uid="config.refuse_what_is_from_before")
