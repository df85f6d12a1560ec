"""Which models a training can begin with the weights of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .trainer.network import build_of

if TYPE_CHECKING:
    from evaluation.models import TrainedModel


def build_of_model(model: TrainedModel) -> str | None:
    """How the model's network is built, by the names of :data:`.trainer.network.BUILDS`; None for one that cannot be
    learned on here.

    Told by the number of its weights. Where that misleads, the trainer says so: only it reads a stranger's file.
    """
    if model.metadata.get("frame_stack", 1) > 1:  # trainings here read one observation at a time
        return None
    return build_of(model.metadata, model.network.parameters)
