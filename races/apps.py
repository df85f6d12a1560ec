from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class RacesConfig(AppConfig):
    name = "races"
    verbose_name = _("Races")

    def ready(self) -> None:
        from evaluation.signals import evaluation_ended

        from .receivers import take_ended_evaluation

        evaluation_ended.connect(take_ended_evaluation, dispatch_uid="races.take_ended_evaluation")
