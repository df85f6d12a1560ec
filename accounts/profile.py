"""What a racer says about themselves."""

from __future__ import annotations

from datetime import datetime

from django.db import transaction

from .models import Racer
from .teams.services import set_team_name


@transaction.atomic
def change_profile(*, racer: Racer, country: str, now: datetime, team: str | None = None) -> Racer:
    """Set what stands beside the alias on boards: a country's code or "", and where ``team`` is said the racer's team
    by its name (:func:`accounts.teams.services.set_team_name`).

    Raises django.core.exceptions.ValidationError, by field, for values that a racer cannot have.
    """
    before = racer.country
    racer.country = country
    racer.clean_fields(exclude={field.name for field in Racer._meta.fields} - {"country"})
    try:
        if team is not None:
            set_team_name(racer=racer, name=team.strip(), now=now)
    except Exception:
        racer.country = before
        raise
    racer.save(update_fields=["country"])
    return racer
