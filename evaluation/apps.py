from django.apps import AppConfig
from django.db.models.signals import post_delete
from django.utils.translation import gettext_lazy as _


class EvaluationConfig(AppConfig):
    name = "evaluation"
    verbose_name = _("Evaluation")

    def ready(self) -> None:
        from accounts import quotas, storage
        from core.jobs.outages import look_after_faults

        from . import events, streams  # noqa: F401 - its kinds of events are known from the start
        from .models import TrainedModel
        from .quotas import MODELS, NETWORKS, STORAGE, TRACES, UPLOADS
        from .reports import jobs  # noqa: F401 - its kind of job is known from the start
        from .reports.quotas import ALL
        from .sandbox import probe as probing
        from .services.sources import take_source_along

        quotas.register(MODELS)
        streams.register()
        quotas.register(STORAGE)
        for quota in ALL:
            quotas.register(quota)
        storage.register(NETWORKS)
        storage.register(TRACES)
        storage.register(UPLOADS)
        post_delete.connect(take_source_along, sender=TrainedModel, dispatch_uid="evaluation.take_source_along")
        # the turns of a worker end where it says that the sandbox is gone
        look_after_faults("sandbox_failed", lambda: probing.look_again())
