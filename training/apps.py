from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TrainingConfig(AppConfig):
    name = "training"
    verbose_name = _("Training")

    def ready(self) -> None:
        from accounts.quotas import register

        from .quotas import AT_ONCE, MINUTES

        register(AT_ONCE)
        register(MINUTES)
