"""Reserved aliases: names that would make a racer look like an official of the site."""

import re
from datetime import datetime

from django.db.models import Q
from django.utils.crypto import salted_hmac

from ..models import NAMELESS, Racer, ReservedAlias

# By a word of their own: house-flyer and admin_jane as well.
_OFFICES = """
admin administrator administration house mod moderator official officials operator organiser organizer owner paddock
program root staff steward stewards support sysadmin superuser system webmaster
"""
# As a whole.
_NAMES = """
about abuse account accounts all anonymous anyone api app billing bot bots contact docs deleted everybody everyone
example guest health help host hostmaster info league localhost login logout me moderation new nobody none noreply
notices null password postmaster privacy race racer racers races removed results rules season seasons security service
signup static status team test track tracks train training undefined unknown user users webhooks workers www you
"""
# Marks that look like letters; l, i and 1 are one, and so are o and 0.
_LOOKS = str.maketrans({"0": "o", "1": "l", "i": "l", "3": "e", "4": "a", "5": "s", "7": "t", "8": "b", "9": "g"})


def folded(alias: str) -> str:
    """The alias as it looks at a glance: without case and separators, look-alikes as one."""
    return re.sub("[-_]", "", alias.lower()).translate(_LOOKS).replace("rn", "m").replace("vv", "w")


def is_reserved(alias: str) -> bool:
    """Whether an alias is reserved, looks like a reserved one, or contains a word for an office."""
    words = {folded(word) for word in re.split("[-_]+", alias)}
    is_nameless = folded(alias).startswith(folded(NAMELESS))
    return folded(alias) in RESERVED or bool(words & OFFICES) or is_nameless


def is_taken(alias: str, now: datetime, racer: Racer | None = None) -> bool:
    """Whether an alias, or one that looks like it, is reserved for a former owner other than ``racer``."""
    others = ~Q(racer=racer) if racer is not None else Q()
    return ReservedAlias.objects.filter(others, digest=_digest(alias), until__gt=now).exists()


def reserve(*, alias: str, until: datetime, racer: Racer | None) -> None:
    """Keep an alias for a racer, or (None) for nobody, until then."""
    ReservedAlias.objects.update_or_create(digest=_digest(alias), defaults={"until": until, "racer": racer})


def forget_reservation(*, alias: str) -> None:
    """Its former owner has the alias again."""
    ReservedAlias.objects.filter(digest=_digest(alias)).delete()


def _digest(alias: str) -> str:
    """What is kept of an alias, so that a deleted account's name is not in the database."""
    return salted_hmac("accounts.reserved_alias", folded(alias), algorithm="sha256").hexdigest()


OFFICES = frozenset(map(folded, _OFFICES.split()))
RESERVED = OFFICES | frozenset(map(folded, _NAMES.split()))
