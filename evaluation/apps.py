from django.apps import AppConfig
from django.db.models.signals import post_delete
from django.utils.translation import gettext_lazy as _


class EvaluationConfig(AppConfig):
    name = "evaluation"
    verbose_name = _("Evaluation")

    def ready(self) -> None:
        from accounts import quotas
        from accounts.usage import storage
        from core.jobs.outages import look_after_faults

        from .garage.original_uploads import take_source_along
        from .garage.quotas import MODELS, NETWORKS, STORAGE, TRACES, UPLOADS
        from .models import TrainedModel
        from .reports import jobs  # noqa: F401 - its kind of job is known from the start
        from .reports.quotas import ALL
        from .running.events import register_streams  # also registers the kinds of events
        from .sandbox import probe as probing

        quotas.register(MODELS)
        register_streams()
        quotas.register(STORAGE)
        for quota in ALL:
            quotas.register(quota)
        storage.register(NETWORKS)
        storage.register(TRACES)
        storage.register(UPLOADS)
        post_delete.connect(take_source_along, sender=TrainedModel, dispatch_uid="evaluation.take_source_along")
        # a worker takes no more turns after this reports that the sandbox is gone
        look_after_faults("sandbox_failed", lambda: probing.look_again())
