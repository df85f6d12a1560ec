"""The cars that a form offers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from django.utils.translation import gettext_lazy as _

from .selectors import models_of, shared_models

if TYPE_CHECKING:
    from accounts.models import Racer

SHARED_OFFERED = 100  # of the models that others share, the latest; any other comes by the address of its page


def cars_of(racer: Racer, *asked: str | None) -> list[tuple[Any, Any]]:
    """The cars that a racer may choose from, for a select: their own, what the house has, the latest that others share;
    and those ``asked`` for, by their public ids."""
    mine = [(model.public_id, model.name) for model in models_of(racer).order_by("name")]
    shared = shared_models(racer).exclude(owner=racer)
    house = [(model.public_id, model.name) for model in shared.filter(owner__is_house=True).order_by("name")]
    others = list(shared.filter(owner__is_house=False)[:SHARED_OFFERED])
    wanted = [one for one in asked if one and one not in {model.public_id for model in others}]
    others += list(shared.filter(owner__is_house=False, public_id__in=wanted))
    told = [(model.public_id, f"{model.name} · {model.owner.alias}") for model in others]
    groups = [(_("My models"), mine), (_("House cars"), house), (_("Shared with me"), told)]
    return [(name, cars) for name, cars in groups if cars]
