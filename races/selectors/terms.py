"""Who has accepted a race's terms."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import Max, QuerySet

from paddock.errors import UserFault

from ..models import Entry, Race, TermsAcceptance

if TYPE_CHECKING:
    from accounts.models import Racer


def has_accepted(entry: Entry | None, race: Race) -> bool:
    """Whether nothing is left to accept: a race without terms asks nobody, and none asks house cars."""
    if not race.terms_version or (entry is not None and entry.is_baseline):
        return True
    accepted = TermsAcceptance.objects.filter(entry=entry, terms__version=race.terms_version)
    return entry is not None and accepted.exists()


def check_terms(race: Race, racer: Racer) -> None:
    """Raise UserFault("race_terms") where the racer would have to accept terms before a car is sent: for what is sent
    later, when nobody is there to be asked."""
    if not race.terms_version or racer.is_house:
        return
    if not has_accepted(Entry.objects.filter(race=race, racer=racer).first(), race):
        raise UserFault("race_terms", version=race.terms_version)


def with_accepted_terms(entries: QuerySet[Entry]) -> QuerySet[Entry]:
    """``entries`` with the newest version that each has accepted (``terms_version``, None for none) and when
    (``terms_at``)."""
    return entries.annotate(
        terms_version=Max("accepted_terms__terms__version"), terms_at=Max("accepted_terms__accepted_at")
    )
