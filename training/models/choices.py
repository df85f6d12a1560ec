"""Choices of training jobs and vehicles."""

from __future__ import annotations

import re

from django.db import models
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext_lazy

_COMMAS_OF_2018 = 11  # of twelve arguments: POSITIONAL_NAMES in rewards.sandbox.function, which imports the physics
_ARGUMENTS = re.compile(r"^def[ \t]+reward_function[ \t]*\(([^)]*)\)", re.MULTILINE)


class Algorithm(models.TextChoices):
    PPO = "ppo", _("PPO")
    SAC = "sac", _("SAC")


class JobState(models.TextChoices):
    """The states of a training job. FINISHED, FAILED and STOPPED are final."""

    QUEUED = "queued", _("queued")
    RUNNING = "running", _("training")
    FINISHED = "finished", pgettext_lazy("a training", "finished")
    FAILED = "failed", _("failed")
    STOPPED = "stopped", _("stopped")


class EndReason(models.TextChoices):
    """Why a training ended: one of its stop conditions, its owner or an admin, or the job's reason."""

    TIME = "time", pgettext_lazy("why a training ended", "time limit reached")
    STEPS = "steps", pgettext_lazy("why a training ended", "step limit reached")
    CLEAN_LAPS = "clean_laps", pgettext_lazy("why a training ended", "goal reached")
    STOPPED = "stopped", pgettext_lazy("why a training ended", "stopped")
    FAILED = "failed", pgettext_lazy("why a training ended", "failed")


UNDER_WAY = (JobState.QUEUED, JobState.RUNNING)
FINAL_STATES = (JobState.FINISHED, JobState.FAILED, JobState.STOPPED)


class BestMetric(models.TextChoices):
    """What makes one evaluation better than another (deepracer-simapp, BEST_MODEL_METRIC)."""

    PROGRESS = "progress", _("progress")
    REWARD = "reward", _("reward")
    LAP_TIME = "lap_time", _("lap time")


class RewardSignature(models.TextChoices):
    """How a reward function takes the car's state: one dict, or the first form of 2018 with separate values."""

    PARAMS = "params", _("reward_function(params)")
    POSITIONAL = "positional", _("the 2018 form with separate values")

    @classmethod
    def of(cls, code: str) -> RewardSignature:
        """The form by the commas among the arguments. The code is not parsed: a text can occupy the parser for ten
        seconds, which only the sandbox limits."""
        found = _ARGUMENTS.search(code)
        return cls.POSITIONAL if found and found[1].count(",") >= _COMMAS_OF_2018 else cls.PARAMS


class NeuralNetwork(models.TextChoices):
    """The depth of a network, by the names of ``model_metadata.json``."""

    SHALLOW = "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", _("shallow")
    MIDDLE = "DEEP_CONVOLUTIONAL_NETWORK", _("middle")
    DEEP = "DEEP_CONVOLUTIONAL_NETWORK_DEEP", _("deep")
