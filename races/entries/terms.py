"""The terms of races: written in versions, accepted with the entry."""

from datetime import datetime

from django.db.models import Max, QuerySet

from accounts.models import Racer
from paddock.errors import UserFault

from ..models import Entry, Race, RaceTerms, TermsAcceptance


def has_accepted(entry: Entry | None, race: Race) -> bool:
    """Whether the racer has accepted the current terms; always true without terms and for house cars."""
    if not race.terms_version or (entry is not None and entry.is_baseline):
        return True
    accepted = TermsAcceptance.objects.filter(entry=entry, terms__version=race.terms_version)
    return entry is not None and accepted.exists()


def check_terms(race: Race, racer: Racer) -> None:
    """Raise UserFault("race_terms") if the racer must accept terms before a submission: for automatic submissions."""
    if not race.terms_version or racer.is_house:
        return
    if not has_accepted(Entry.objects.filter(race=race, racer=racer).first(), race):
        raise UserFault("race_terms", version=race.terms_version)


def with_accepted_terms(entries: QuerySet[Entry]) -> QuerySet[Entry]:
    """``entries`` with the newest version that each has accepted (``terms_version``) and when (``terms_at``)."""
    return entries.annotate(
        terms_version=Max("accepted_terms__terms__version"), terms_at=Max("accepted_terms__accepted_at")
    )


def one_form(text: str) -> str:
    """Terms as they are kept: a browser ends lines otherwise than a program, which is no other version."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def keep_terms(race: Race, now: datetime) -> None:
    """Write down the terms that a race has just been given, as the next version; a race without any has version 0."""
    last = RaceTerms.objects.filter(race=race).order_by("-version").first()
    version = last.version if race.terms and last else 0
    if race.terms and (last is None or last.text != race.terms):
        version += 1
        RaceTerms.objects.create(race=race, version=version, text=race.terms, written_at=now)
    if version != race.terms_version:
        race.terms_version = version
        race.save(update_fields=["terms_version"])


def accept_terms(entry: Entry, race: Race, *, accepted: int | None, now: datetime) -> None:
    """Record the racer's acceptance of the current terms. Raises UserFault("race_terms") for another version."""
    if has_accepted(entry, race):
        return
    if accepted != race.terms_version:
        raise UserFault("race_terms", version=race.terms_version)
    terms = RaceTerms.objects.get(race=race, version=accepted)
    TermsAcceptance.objects.get_or_create(entry=entry, terms=terms, defaults={"accepted_at": now})
