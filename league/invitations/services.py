"""Invitations to a race by e-mail: reading address lists, sending, accepting, withdrawing."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.core import signing
from django.core.exceptions import ValidationError
from django.core.mail.message import EmailMessage
from django.core.validators import validate_email
from django.db import transaction
from django.db.models import Count, F
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from accounts.quotas import CountedRows, Quota, Racers, limit_of, only, used_by
from core.audit.recording import audited
from core.database.columns import length_of
from core.database.locks import hold
from core.jobs.kinds import register
from core.jobs.mails import MailKind
from core.wakeups.workers import wake
from paddock.errors import UserFault
from races.entries.selectors.visibility import can_organise
from races.entries.services.entries import enter_race
from races.entries.time_checks import require_not_over
from races.models import Entry, Race

from ..models import MailInvitation, NoInvitations

HOLDS_FOR = timedelta(days=30)
A_DAY, A_WEEK = timedelta(days=1), timedelta(days=7)
LONGEST_ADDRESS = length_of(MailInvitation, "email")
AT_ONCE = 500  # addresses in one list
TO_ONE_ADDRESS = 5  # mails in a week from all organisers; more are not sent
_LINK, _STOP = "league.inviting.link", "league.inviting.stop"


class Invitations(MailKind[MailInvitation]):
    name, model, task = "Invitation", MailInvitation, "league.tasks.notices"
    since = "asked_at"
    related = ("race", "made_by")

    def message(self, job: MailInvitation, now: datetime) -> EmailMessage | None:
        return _message(job) if job.standing_at(now) == "invited" and not _wants_none(job, now) else None


INVITATIONS = register(Invitations())


def _asked(racers: Racers, now: datetime) -> CountedRows:
    """Invitations that were asked for in the last 24 hours; each address is written to once a day at most."""
    asked = MailInvitation.objects.filter(asked_at__gt=now - A_DAY, made_by__isnull=False).order_by()
    return only(asked, "made_by", racers).values_list("made_by").annotate(Count("pk"))


INVITED_A_DAY = Quota(
    11, "invited_a_day", "INVITATIONS_A_DAY", gettext_lazy("Invitations by e-mail in 24 hours"), _asked
)


@dataclass(frozen=True)
class AddressLine:
    """A line of a list. ``source``: its field; ``is_wrong``: whether it holds anything else with an @, or no
    address."""

    source: str
    number: int
    text: str
    addresses: tuple[str, ...]
    is_wrong: bool


def read_addresses(lists: Mapping[str, str]) -> list[AddressLine]:
    """The lines of pasted lists and CSV files by the field that holds them, without names, empty lines and a
    heading."""
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


@audited("mail_invitation.sent", gettext_lazy("Racers invited by e-mail"), target="race")
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
    MailInvitation.objects.bulk_create(
        MailInvitation(race=race, email=address, made_by=by, asked_at=now, expires_at=expires, language=language)
        for address in new
    )
    if new:
        wake(INVITATIONS.task)
    return len(new)


@audited("mail_invitation.repeated", gettext_lazy("Invitation sent again"), target="invitation")
@transaction.atomic
def invite_again(*, invitation: MailInvitation, by: Racer, now: datetime) -> MailInvitation:
    """Send another mail, whose link replaces the one before; a withdrawn invitation is valid again.

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
    wake(INVITATIONS.task)
    invitation.refresh_from_db()
    return invitation


@audited("mail_invitation.withdrawn", gettext_lazy("Invitation withdrawn"), target="invitation")
def withdraw_invitation(*, invitation: MailInvitation, by: Racer, now: datetime) -> MailInvitation:
    """Its link joins nobody any more. Raises UserFault("race_not_yours" | "invitation_taken")."""
    _require_organiser(invitation.race, by)
    open_ = MailInvitation.objects.filter(pk=invitation.pk, accepted_at=None)
    if not open_.update(withdrawn_at=now):
        raise UserFault("invitation_taken")
    invitation.refresh_from_db()
    return invitation


def link_token(invitation: MailInvitation) -> str:
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
    """Enter the race of a personal link, which is used up by it. Raises UserFault("invitation_unknown") for an invalid
    link, else what entering a race raises; then the link stays valid."""
    invitation = invitation_of(token, now)
    if invitation is None:
        raise UserFault("invitation_unknown")
    entry = enter_race(race=invitation.race, racer=racer, now=now, terms=terms, invited=True)
    open_ = MailInvitation.objects.filter(pk=invitation.pk, turn=invitation.turn, accepted_at=None, withdrawn_at=None)
    if not open_.update(accepted_at=now, accepted_by=racer):
        raise UserFault("invitation_unknown")
    return entry


def stop_token(email: str) -> str:
    return signing.dumps(email, salt=_STOP)


def stopped_address(token: str) -> str | None:
    """Whose invitations a token stops; None for a token that this site did not write."""
    try:
        return str(signing.loads(token, salt=_STOP))
    except signing.BadSignature:
        return None


def stop_invitations(*, email: str, now: datetime) -> None:
    """Send no more invitations of any organiser to this address. A repeated call changes nothing."""
    NoInvitations.objects.get_or_create(email=email.lower(), defaults={"at": now})


def send_invitations(*, now: datetime, worker: str = "local") -> int:
    """Send what is due. Returns how many went."""
    return INVITATIONS.send_due(now=now, worker=worker)


def _wants_none(job: MailInvitation, now: datetime) -> bool:
    """Whether the address wants no invitations, or was written to often enough this week by anybody."""
    if NoInvitations.objects.filter(email=job.email).exists():
        return True
    lately = MailInvitation.objects.filter(email=job.email, state="sent", ended_at__gt=now - A_WEEK)
    return lately.count() >= TO_ONE_ADDRESS


def _message(job: MailInvitation) -> EmailMessage:
    stop = f"{settings.SITE_URL}{reverse('invited_stop', args=[stop_token(job.email)])}"
    link = f"{settings.SITE_URL}{reverse('invited', args=[link_token(job)])}"
    with translation.override(job.language):
        inviter = job.made_by.alias if job.made_by is not None else settings.SITE_URL
        subject = _("%(inviter)s invites you to the race %(race)s") % {"inviter": inviter, "race": job.race.name}
        until = f"{job.expires_at:%Y-%m-%d %H:%M} UTC"
        body = "\n\n".join(
            [
                _("%(inviter)s invites you to the race “%(race)s” at %(site)s.")
                % {"inviter": inviter, "race": job.race.name, "site": settings.SITE_URL},
                _("This personal link is for one racer and valid until %(until)s.") % {"until": until},
                link,
                _("No more invitations from this site: %(address)s") % {"address": stop},
            ]
        )
    headers = {"List-Unsubscribe": f"<{stop}>", "List-Unsubscribe-Post": "List-Unsubscribe=One-Click"}
    return EmailMessage(f"[Paddock] {subject}", body + "\n", to=[job.email], headers=headers)


def _require_organiser(race: Race, by: Racer) -> None:
    if not can_organise(by, race):
        raise UserFault("race_not_yours")


def _require_left(by: Racer, number: int, now: datetime) -> None:
    limit = limit_of(by, INVITED_A_DAY.name)
    if used_by(by, INVITED_A_DAY.name, now) + number > limit:
        raise UserFault("invitations_a_day", limit=limit)
