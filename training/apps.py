from importlib.util import find_spec

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class TrainingConfig(AppConfig):
    name = "training"
    verbose_name = _("Training")

    def ready(self) -> None:
        from accounts.quotas import register

        from . import queues
        from .quotas import AT_ONCE, MINUTES

        register(AT_ONCE)
        register(MINUTES)
        queues.register()
        _read_policies_of_sb3()


def _read_policies_of_sb3() -> None:
    """Uploads of stable-baselines3's zips are read where torch is installed, in a process behind the wall."""
    from evaluation.packages.admit import PROCESSES, Reader
    from evaluation.packages.kinds import SB3
    from evaluation.sandbox.limits import SB3_CONVERTER

    if find_spec("torch") is not None:
        PROCESSES[SB3] = Reader("training.sb3.process", SB3_CONVERTER, start_s=120.0, random=True)
