from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _

if TYPE_CHECKING:
    from evaluation.proof import Proof


class TrainingConfig(AppConfig):
    name = "training"
    verbose_name = _("Training")

    def ready(self) -> None:
        from accounts import storage
        from accounts.quotas import register
        from core.pages import register_slots
        from evaluation import proof

        # kinds of events and the reasons that a sandboxed process reports are known from the start
        from . import events, queues, sb3, streams  # noqa: F401
        from .quotas import AT_ONCE, FILES, MINUTES

        register(AT_ONCE)
        register(MINUTES)
        storage.register(FILES)
        queues.register()
        streams.register()
        _read_policies_of_sb3()
        proof.register(_prove)
        register_slots(
            {
                "account.log_in": "training/parts/card_log_in.html",
                "menu.account": "training/parts/menu_classes.html",
                "ways_to_a_car": "training/parts/ways_to_a_car.html",
                "garage.tabs": "training/parts/garage_tabs.html",
                "model.crumb": "training/parts/shared_crumb.html",
                "model.downloads": "training/parts/to_the_car.html",
                "track.print": "training/parts/to_the_car.html",
                "model.actions": "training/parts/model_clone.html",
                "model.races": "training/parts/model_races.html",
                "model.origin": "training/parts/model_origin.html",
                "worth.next": "training/parts/train_on.html",
                "race.train": "training/parts/train_for_race.html",
                "racer.cars": "training/parts/shared_by.html",
            }
        )


def _prove() -> Proof:
    """A worker proves itself by golden runs; what drives them is imported then."""
    from .golden.proof import prove

    return prove()


def _read_policies_of_sb3() -> None:
    """Uploads of stable-baselines3's zips are read where torch is installed, in a process in the sandbox."""
    from evaluation.admit import PROCESSES, UploadReader
    from evaluation.sandbox.limits import SB3_CONVERTER
    from paddock.packages.kinds import SB3

    if find_spec("torch") is not None:
        PROCESSES[SB3] = UploadReader("training.sb3.process", SB3_CONVERTER, start_s=120.0, random=True)
