from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class EvaluationConfig(AppConfig):
    name = "evaluation"
    verbose_name = _("Evaluation")

    def ready(self) -> None:
        from accounts.quotas import register

        from .quotas import MODELS, STORAGE

        register(MODELS)
        register(STORAGE)
