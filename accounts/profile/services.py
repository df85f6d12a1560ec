"""A racer's public profile."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from django.db import transaction

from ..models import Racer
from ..teams.services import set_team_name
from .fields import editable


@transaction.atomic
def change_profile(*, racer: Racer, values: Mapping[str, Any], now: datetime, team: str | None = None) -> Racer:
    """Set editable profile fields by name, and ``team`` (:func:`accounts.teams.services.set_team_name`). Raises
    ValidationError by field, and ValueError for another field."""
    if not values.keys() <= editable().keys():
        raise ValueError(f"racers edit {', '.join(editable())} only, not {', '.join(values)}")
    before = {name: getattr(racer, name) for name in values}
    for name, value in values.items():
        setattr(racer, name, value)
    racer.clean_fields(exclude={field.name for field in Racer._meta.fields} - values.keys())
    try:
        if team is not None:
            set_team_name(racer=racer, name=team.strip(), now=now)
    except Exception:  # any refusal: the racer keeps the old values, and the caller gets the error
        for name, value in before.items():
            setattr(racer, name, value)
        raise
    racer.save(update_fields=list(values))
    return racer
