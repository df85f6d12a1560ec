"""Inviting to a race by e-mail: asking, sending, accepting, taking back."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.core import signing
from django.core.exceptions import ValidationError
from django.core.mail import get_connection
from django.core.mail.message import EmailMessage
from django.core.validators import validate_email
from django.db import transaction
from django.db.models import Count, F, QuerySet
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from accounts.quotas import Quota, limit_of, used_by
from core.columns import length_of
from core.jobs.kinds import JobKind, register
from core.locks import hold
from core.wakeup import wake
from paddock.errors import UserFault
from races.models import Entry, Race
from races.selectors import can_organise
from races.services.entries import enter_as_invited
from races.services.gates import require_not_over

from ..models import MailInvitation, NoInvitations
from .mails import LEASE, MAIL_TRIES, MAILS_A_TIME, PAUSE, logger

HOLDS_FOR = timedelta(days=30)
A_DAY, A_WEEK = timedelta(days=1), timedelta(days=7)
LONGEST_ADDRESS = length_of(MailInvitation, "email")
AT_ONCE = 500  # addresses in one list
TO_ONE_ADDRESS = 5  # mails in a week, whoever invites: more of them go nowhere
TASK = "league.tasks.notices"
_LINK, _STOP = "league.inviting.link", "league.inviting.stop"


class Invitations(JobKind[MailInvitation]):
    """First come, first sent. One whose sender was lost is given up: it may have gone, and is not sent twice."""

    name, model, task, queue = "Invitation", MailInvitation, TASK, "messages"
    waiting, working, finished = "due", "sending", "sent"
    related = ("race", "made_by")
    needs = ()

    @property
    def lease(self) -> timedelta:
        return LEASE

    def lost(self, mine: QuerySet[MailInvitation], job: MailInvitation, now: datetime) -> bool:
        return self.end(mine, state=self.failed, now=now)


INVITATIONS = register(Invitations())


def _asked(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Invitations that were asked for in the last 24 hours; each address is written to once a day at most."""
    asked = MailInvitation.objects.filter(asked_at__gt=now - A_DAY, made_by__isnull=False).order_by()
    if racers is not None:
        asked = asked.filter(made_by__in=racers)
    return dict(asked.values_list("made_by").annotate(Count("pk")))


INVITED_A_DAY = Quota(
    11, "invited_a_day", "INVITATIONS_A_DAY", gettext_lazy("Invitations by e-mail in 24 hours"), _asked
)


@dataclass(frozen=True)
class AddressLine:
    """A line of a list. ``source``: the field it came from; ``addresses``: those in it that are e-mail addresses;
    ``is_wrong``: whether it holds anything else with an @, or no address at all."""

    source: str
    number: int
    text: str
    addresses: tuple[str, ...]
    is_wrong: bool


def read_addresses(lists: Mapping[str, str]) -> list[AddressLine]:
    """The lines of pasted lists and CSV files by the field that holds them: one or several addresses a line, names
    beside them are left out, empty lines and a heading too."""
    lines = []
    for source, text in lists.items():
        for number, line in enumerate(text.splitlines(), start=1):
            words = [word.strip("<>\"'()[] ") for word in re.split(r"[\s,;\t]+", line)]
            named = [word for word in words if "@" in word]
            header = number == 1 and not named and re.search(r"mail", line, re.IGNORECASE)
            if any(words) and not header:
                good = tuple(word.lower() for word in named if _is_address(word))
                wrong = not good or len(good) < len(named)
                lines.append(AddressLine(source, number, line.strip(), good, wrong))
    return lines


def addresses_of(lines: Iterable[AddressLine]) -> list[str]:
    """The addresses of a list, each once. Raises UserFault("invited_none"), "invited_too_many"."""
    found = list(dict.fromkeys(address for line in lines for address in line.addresses))
    if not found:
        raise UserFault("invited_none")
    if len(found) > AT_ONCE:
        raise UserFault("invited_too_many", limit=AT_ONCE)
    return found


def _is_address(word: str) -> bool:
    try:
        validate_email(word)
    except ValidationError:
        return False
    return len(word) <= LONGEST_ADDRESS


@transaction.atomic
def invite_by_mail(*, race: Race, by: Racer, addresses: Iterable[str], language: str, now: datetime) -> int:
    """Invite these addresses (:func:`addresses_of`) to a race; racers with an invitation keep it. How many are
    new. All or none: raises UserFault("race_not_yours" | "race_closed" | "race_cancelled" | "invitations_a_day")."""
    _require_organiser(race, by)
    require_not_over(race, now)
    hold(by)
    known = set(MailInvitation.objects.filter(race=race).values_list("email", flat=True))
    new = [address for address in dict.fromkeys(addresses) if address not in known]
    _require_left(by, len(new), now)
    expires = min(now + HOLDS_FOR, race.closes_at)
    common: dict[str, Any] = {"race": race, "made_by": by, "asked_at": now, "expires_at": expires, "language": language}
    MailInvitation.objects.bulk_create([MailInvitation(email=address, **common) for address in new])
    if new:
        wake(TASK)
    return len(new)


@transaction.atomic
def invite_again(*, invitation: MailInvitation, by: Racer, now: datetime) -> MailInvitation:
    """Send another mail; the link of the one before is worth nothing any more. It comes back, if it was withdrawn.

    Raises UserFault("race_not_yours" | "race_closed" | "race_cancelled" | "invitation_taken" | "invitation_too_soon" |
    "invitations_a_day").
    """
    _require_organiser(invitation.race, by)
    require_not_over(invitation.race, now)
    hold(by)
    one = MailInvitation.objects.select_for_update().get(pk=invitation.pk)
    if one.accepted_at is not None:
        raise UserFault("invitation_taken")
    if one.state in ("due", "sending") or one.asked_at > now - A_DAY:
        raise UserFault("invitation_too_soon")
    _require_left(by, 1, now)
    MailInvitation.objects.filter(pk=one.pk).update(
        turn=F("turn") + 1,
        made_by=by,
        asked_at=now,
        withdrawn_at=None,
        expires_at=min(now + HOLDS_FOR, invitation.race.closes_at),
        state="due",
        attempt=0,
        ended_at=None,
        started_at=None,
    )
    wake(TASK)
    invitation.refresh_from_db()
    return invitation


def withdraw_invitation(*, invitation: MailInvitation, by: Racer, now: datetime) -> MailInvitation:
    """Its link joins nobody any more. Raises UserFault("race_not_yours" | "invitation_taken")."""
    _require_organiser(invitation.race, by)
    open_ = MailInvitation.objects.filter(pk=invitation.pk, accepted_at=None)
    if not open_.update(withdrawn_at=now):
        raise UserFault("invitation_taken")
    invitation.refresh_from_db()
    return invitation


def link_token(invitation: MailInvitation) -> str:
    """What the link of an invitation carries."""
    return signing.dumps([invitation.pk, invitation.turn], salt=_LINK)


def invitation_of(token: str, now: datetime) -> MailInvitation | None:
    """The invitation of a link with which somebody may still join; None for any other."""
    try:
        pk, turn = signing.loads(token, salt=_LINK)
    except (signing.BadSignature, ValueError, TypeError):
        return None
    open_ = MailInvitation.objects.filter(accepted_at=None, withdrawn_at=None, expires_at__gt=now)
    return open_.filter(pk=pk, turn=turn).select_related("race__track", "race__organiser").first()


@transaction.atomic
def accept_mail_invitation(*, token: str, racer: Racer, now: datetime, terms: int | None = None) -> Entry:
    """Enter the race of a personal link, which is used up by it.

    Raises UserFault("invitation_unknown") for one that was used, replaced, withdrawn or is over, else what entering a
    race raises; then the link stays good.
    """
    invitation = invitation_of(token, now)
    if invitation is None:
        raise UserFault("invitation_unknown")
    entry = enter_as_invited(race=invitation.race, racer=racer, now=now, terms=terms)
    open_ = MailInvitation.objects.filter(pk=invitation.pk, turn=invitation.turn, accepted_at=None, withdrawn_at=None)
    if not open_.update(accepted_at=now, accepted_by=racer):
        raise UserFault("invitation_unknown")
    return entry


def stop_token(email: str) -> str:
    """What a mail carries so that its reader gets no more invitations."""
    return signing.dumps(email, salt=_STOP)


def stopped_address(token: str) -> str | None:
    """Whose invitations a token stops; None for a token that this site did not write."""
    try:
        return str(signing.loads(token, salt=_STOP))
    except signing.BadSignature:
        return None


def stop_invitations(*, email: str, now: datetime) -> None:
    """Send no more invitations to this address, whoever asks. Doing it again changes nothing."""
    NoInvitations.objects.get_or_create(email=email.lower(), defaults={"at": now})


def send_invitations(*, now: datetime, worker: str = "local") -> int:
    """Send what is due: each at most once, three tries if the mail server refuses. Returns how many went."""
    INVITATIONS.sweep(now=now, wake=False)
    sent = 0
    with get_connection() as server:
        for _number in range(MAILS_A_TIME):
            job = INVITATIONS.claim(worker=worker, now=now)
            if job is None:
                break
            sent += _send(job, server, now)
    return sent


def _send(job: MailInvitation, server: Any, now: datetime) -> bool:
    mine = INVITATIONS.held(job.pk, job.lease)
    if job.standing_at(now) != "invited" or _wants_none(job, now):
        INVITATIONS.end(mine, state="failed", now=now)
        return False
    try:
        _message(job, server).send()
    except Exception as error:  # whatever the mail backend raises: it is tried again, then given up
        if job.attempt < MAIL_TRIES:
            INVITATIONS.put_back(mine, now=now, pause=PAUSE)
        else:
            INVITATIONS.end(mine, state="failed", now=now)
        trace = None if isinstance(error, OSError) else error
        logger.warning("An invitation could not be sent (try %s): %s", job.attempt, error, exc_info=trace)
        return False
    return INVITATIONS.end(mine, state="sent", now=now)


def _wants_none(job: MailInvitation, now: datetime) -> bool:
    """Whether the address wants no invitations, or was written to often enough this week by anybody."""
    if NoInvitations.objects.filter(email=job.email).exists():
        return True
    lately = MailInvitation.objects.filter(email=job.email, state="sent", ended_at__gt=now - A_WEEK)
    return lately.count() >= TO_ONE_ADDRESS


def _message(job: MailInvitation, server: Any) -> EmailMessage:
    stop = f"{settings.SITE_URL}{reverse('invited_stop', args=[stop_token(job.email)])}"
    link = f"{settings.SITE_URL}{reverse('invited', args=[link_token(job)])}"
    with translation.override(job.language):
        who = job.made_by.alias if job.made_by is not None else settings.SITE_URL
        subject = _("%(who)s invites you to the race %(race)s") % {"who": who, "race": job.race.name}
        until = f"{job.expires_at:%Y-%m-%d %H:%M} UTC"
        body = "\n\n".join(
            [
                _("%(who)s invites you to the race “%(race)s” at %(site)s.")
                % {"who": who, "race": job.race.name, "site": settings.SITE_URL},
                _("This personal link is for one racer and valid until %(until)s.") % {"until": until},
                link,
                _("No more invitations from this site: %(address)s") % {"address": stop},
            ]
        )
    headers = {"List-Unsubscribe": f"<{stop}>", "List-Unsubscribe-Post": "List-Unsubscribe=One-Click"}
    return EmailMessage(f"[Paddock] {subject}", body + "\n", to=[job.email], connection=server, headers=headers)


def _require_organiser(race: Race, by: Racer) -> None:
    if not can_organise(by, race):
        raise UserFault("race_not_yours")


def _require_left(by: Racer, number: int, now: datetime) -> None:
    limit = limit_of(by, INVITED_A_DAY.name)
    if used_by(by, INVITED_A_DAY.name, now) + number > limit:
        raise UserFault("invitations_a_day", limit=limit)
