"""The terms of races: written in versions, accepted with the entry."""

from __future__ import annotations

from datetime import datetime

from paddock.errors import UserFault

from ..models import Entry, Race, RaceTerms, TermsAcceptance
from ..selectors.terms import has_accepted


def one_form(text: str) -> str:
    """Terms as they are kept: a browser ends lines otherwise than a program, which is no other version."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def keep_terms(race: Race, now: datetime) -> None:
    """Write down the terms that a race has just been given, as the next version; a race without any has version 0."""
    last = RaceTerms.objects.filter(race=race).order_by("-version").first()
    version = 0
    if race.terms:
        version = last.version if last else 0
        if last is None or last.text != race.terms:
            version += 1
            RaceTerms.objects.create(race=race, version=version, text=race.terms, written_at=now)
    if version != race.terms_version:
        race.terms_version = version
        race.save(update_fields=["terms_version"])


def accept_terms(entry: Entry, race: Race, *, accepted: int | None, now: datetime) -> None:
    """Note that the racer accepts version ``accepted`` of the race's terms, where that is the one that stands.

    Raises UserFault("race_terms") (with ``version``) where the race has terms that the racer has not accepted.
    """
    if has_accepted(entry, race):
        return
    if accepted != race.terms_version:
        raise UserFault("race_terms", version=race.terms_version)
    terms = RaceTerms.objects.get(race=race, version=accepted)
    TermsAcceptance.objects.get_or_create(entry=entry, terms=terms, defaults={"accepted_at": now})
