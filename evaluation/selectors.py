"""Querysets and permission checks for models: own, visible and shared."""

from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.db.models import Expression, F, Q, QuerySet

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value

from .models import TrainedModel

# A deactivated racer shares nothing, and what drives for the house belongs to everybody.
_SHARED = Q(Q(shared_at__isnull=False) | Q(owner__is_house=True), owner__is_active=True, deleted_at=None)


def models_of(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """The racer's garage, newest first; empty for somebody who is not logged in. Twin of :func:`can_use_model`."""
    return garage_of(racer.pk)


def garage_of(racer: int | Expression | None) -> QuerySet[TrainedModel]:
    """:func:`models_of` for the racer of an id."""
    return TrainedModel.objects.filter(owner_id=racer, deleted_at=None).select_related("network", "owner")


def can_use_model(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may see, change, race and delete the model: it is theirs and not deleted."""
    return racer.pk is not None and model.owner_id == racer.pk and model.deleted_at is None


def visible_models(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """Models that the racer may look at, download and train on from: their own, and what others share. Twin of
    :func:`can_see_model`. Admins see what others see; the admin site shows them the rest."""
    return TrainedModel.objects.none() if racer.pk is None else _visible_to(racer.pk)


def _visible_to(racer: Any) -> QuerySet[TrainedModel]:
    models = TrainedModel.objects.select_related("network", "owner")
    return models.filter(_SHARED | Q(owner_id=racer, deleted_at=None))


_visible = KeptQuery(lambda racer, public_id: _visible_to(racer).filter(public_id=public_id))


def visible_model(racer: Racer, public_id: str) -> TrainedModel | None:
    """The model of this id, if it is one of :func:`visible_models`."""
    return next(iter(_visible(racer=racer.pk, public_id=public_id)), None)


def can_see_model(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may look at the model, download it and train on from it: it is theirs, or shared."""
    return racer.pk is not None and (can_use_model(racer, model) or is_shared(model))


def shared_models(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """What racers share and the house's cars, the latest first; nothing for somebody who is not logged in. Twin of
    :func:`is_shared`."""
    models = TrainedModel.objects.select_related("network", "owner")
    if racer.pk is None:
        return models.none()
    return models.filter(_SHARED).order_by(F("shared_at").desc(nulls_last=True), "-pk")


def newest_shared(reader: Racer, most: int, *, house: bool = True) -> list[TrainedModel]:
    """The latest of :func:`shared_models` that are not the reader's, with the house's unless ``house`` is false. One
    query for all readers, except for one who shares most of them."""

    def models() -> QuerySet[TrainedModel]:
        return shared_models(reader).filter(**({} if house else {"owner__is_house": False}))

    newest = shared_value(("newest shared models", most, house), lambda: list(models()[: 2 * most]))
    others = [model for model in newest if model.owner_id != reader.pk]
    if len(others) < most and len(newest) == 2 * most:
        return list(models().exclude(owner=reader)[:most])
    return others[:most]


def is_shared(model: TrainedModel) -> bool:
    """Whether every racer may look at the model, download it and train on from it."""
    owner = model.owner
    return model.deleted_at is None and owner.is_active and (model.shared_at is not None or owner.is_house)


def can_stop_sharing(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may end the sharing of a model: its owner, or an admin."""
    return racer.pk is not None and model.shared_at is not None and (racer.pk == model.owner_id or racer.is_staff)
