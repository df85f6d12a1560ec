from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class EvaluationConfig(AppConfig):
    name = "evaluation"
    verbose_name = _("Evaluation")

    def ready(self) -> None:
        from accounts import quotas, storage

        from . import events  # noqa: F401 - its kinds of events are known from the start
        from .quotas import MODELS, NETWORKS, STORAGE, TRACES

        quotas.register(MODELS)
        quotas.register(STORAGE)
        storage.register(NETWORKS)
        storage.register(TRACES)
