"""What this room does when the room below tells something."""

from __future__ import annotations

from evaluation.models import TrainedModel

from .services import remove_videos_of_model


def take_deleted_model(sender: object, *, model: TrainedModel, **kwargs: object) -> None:
    """Who deletes a model wants no more videos of it."""
    remove_videos_of_model(model=model)
