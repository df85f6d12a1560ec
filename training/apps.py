from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

from django.apps import AppConfig
from django.conf import settings
from django.utils.translation import gettext_lazy as _

from paddock.simulator.engine import ENGINE_ID

if TYPE_CHECKING:
    from evaluation.running.proof import Proof


class TrainingConfig(AppConfig):
    name = "training"
    verbose_name = _("Training")

    def ready(self) -> None:
        from accounts.quotas import register
        from accounts.usage import storage
        from core.pages.registry import register_slots
        from core.streams import Topic, register_moves, register_topic
        from evaluation.running import proof
        from races.telemetry import rewards

        # register the kinds of events and the reasons of sandboxed processes
        from . import events, sb3  # noqa: F401
        from .jobs.run_rewards import rewards_of_runs
        from .jobs.selectors import moves, sees_training
        from .jobs.services.queue import register_operators_queue
        from .quotas import AT_ONCE, FILES, MINUTES
        from .sweeps.selectors import sees_sweep

        register(AT_ONCE)
        register(MINUTES)
        storage.register(FILES)
        register_operators_queue()
        register_topic(Topic("training", sees_training))
        register_topic(Topic("sweep", sees_sweep))
        register_moves(moves)
        _read_policies_of_sb3()
        proof.register(_prove)
        rewards.SOURCES.append(rewards_of_runs)
        register_slots(
            {
                "home.stage": "training/jobs/parts/home_stage.html",
                "ways_to_a_car": "training/starter_training/parts/ways_to_a_car.html",
                "garage.tabs": "training/vehicles/parts/garage_tabs.html",
                "model.crumb": "training/cloning/parts/shared_crumb.html",
                "model.downloads": "training/lessons/parts/to_the_car.html",
                "track.print": "training/lessons/parts/to_the_car.html",
                "model.actions": "training/cloning/parts/model_clone.html",
                "model.races": "training/parts/model_races.html",
                "model.origin": "training/cloning/parts/model_origin.html",
                "worth.next": "training/wizard/parts/train_on.html",
                "race.train": "training/wizard/parts/train_for_race.html",
                "racer.cars": "training/cloning/parts/shared_by.html",
            }
        )


def _prove() -> Proof:
    """A worker proves itself by golden runs, in another process: what drives them would keep 50 MB of the worker."""
    from evaluation.running.proof import Proof

    command = [sys.executable, "-m", "training.golden.proof"]
    done = subprocess.run(command, cwd=settings.BASE_DIR, stdout=subprocess.PIPE, text=True, check=False)
    try:
        return Proof.from_dict(json.loads(done.stdout))
    except ValueError:  # it was killed
        why = f"The process of the golden runs ended with status {done.returncode}."
        return Proof(ENGINE_ID, runs=1, equal=0, why=why, settled=False)


def _read_policies_of_sb3() -> None:
    """Uploads of stable-baselines3's zips are read where torch is installed, in a process in the sandbox."""
    from evaluation.garage.admission import PROCESSES, UploadReader
    from evaluation.sandbox.limits import SB3_CONVERTER
    from paddock.packages.kinds import SB3

    if find_spec("torch") is not None:
        PROCESSES[SB3] = UploadReader("training.sb3.process", SB3_CONVERTER, start_s=120.0, random=True)
