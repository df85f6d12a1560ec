from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class EvaluationConfig(AppConfig):
    name = "evaluation"
    verbose_name = _("Evaluation")

    def ready(self) -> None:
        from accounts import quotas, storage
        from core.jobs.outages import look_after_faults

        from . import events  # noqa: F401 - its kinds of events are known from the start
        from .quotas import MODELS, NETWORKS, STORAGE, TRACES
        from .sandbox import probe as probing

        quotas.register(MODELS)
        quotas.register(STORAGE)
        storage.register(NETWORKS)
        storage.register(TRACES)
        # the turns of a worker end where it says that the sandbox is gone
        look_after_faults("sandbox_failed", lambda: probing.look_again())
