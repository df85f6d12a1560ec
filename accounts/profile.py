"""What a racer says about themselves."""

from __future__ import annotations

from .models import Racer


def change_profile(*, racer: Racer, country: str, team: str) -> Racer:
    """Set what stands beside the alias on boards: a country's code or "", and a team or "".

    Raises django.core.exceptions.ValidationError, by field, for values that a racer cannot have.
    """
    racer.country, racer.team = country, team.strip()
    racer.clean_fields(exclude={field.name for field in Racer._meta.fields} - {"country", "team"})
    racer.save(update_fields=["country", "team"])
    return racer
