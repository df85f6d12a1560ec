"""The choice of a model to begin with: own and shared ones in groups, never more of them than one reads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from django import forms
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from evaluation.models import TrainedModel
from evaluation.selectors import models_of, shared_models
from training.selectors import clonable_models

if TYPE_CHECKING:
    from accounts.models import Racer

OWN_LISTED = 100
SHARED_LISTED = 30


class _Groups(forms.models.ModelChoiceIterator):
    """The choices: nothing, the racer's newest models, the latest shared ones, and the one that is chosen."""

    field: CloneField

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        field = self.field
        yield "", field.empty_label
        if field.owner is None:
            return
        own = list(models_of(field.owner).order_by("-created_at", "-pk")[:OWN_LISTED])
        others = list(shared_models(field.owner).exclude(owner=field.owner)[:SHARED_LISTED])
        chosen = self._chosen_beside(own + others)
        if chosen is not None:
            (own if chosen.owner_id == field.owner.pk else others).append(chosen)
        for title, models in ((_("My models"), own), (_("Shared models"), others)):
            if models:
                yield title, [self.choice(model) for model in models]

    def _chosen_beside(self, listed: list[TrainedModel]) -> TrainedModel | None:
        """The chosen model where the lists are too short for it."""
        chosen = self.field.chosen
        if not chosen or any(model.public_id == chosen for model in listed):
            return None
        return self.queryset.filter(public_id=chosen).first()


class CloneField(forms.ModelChoiceField):
    """A model that the racer may train on from. Every such model is taken, whether it is listed or not."""

    iterator = _Groups

    def __init__(self, **kwargs: Any) -> None:
        self.owner: Racer | None = None
        self.chosen = ""
        super().__init__(
            queryset=TrainedModel.objects.none(),
            to_field_name="public_id",
            empty_label=gettext_lazy("nothing: a new network"),
            required=False,
            error_messages={
                "invalid_choice": gettext_lazy(
                    "This model cannot be cloned: it is neither yours nor shared. Choose one of yours or a shared one."
                )
            },
            **kwargs,
        )

    def offer(self, owner: Racer, chosen: Any) -> None:
        """Say whose models are listed, and which one is chosen already (a public id, or nothing)."""
        self.owner, self.chosen = owner, str(chosen or "").replace("\x00", "")[:12]
        self.queryset = clonable_models(owner)

    def label_from_instance(self, model: TrainedModel) -> str:
        if self.owner is not None and model.owner_id == self.owner.pk:
            return model.name
        return f"{model.name} ({model.owner.alias})"
