"""API tokens of a racer. A token's text is shown once; only its digest is stored."""

from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.db import transaction
from django.db.models import Q, QuerySet
from django.utils.translation import gettext_lazy as _
from knox.models import AuthToken, get_token_model

from core.audit.recording import audited
from paddock.errors import UserFault

from ..models import Racer, TokenGrant
from ..scopes import ORGANISE, SCOPES

TOKENS_PER_RACER = 20
LONGEST_DAYS = 366
NOTED_AGAIN_AFTER = timedelta(minutes=10)  # so that not every request writes


def tokens_of(racer: Racer, now: datetime) -> QuerySet[AuthToken]:
    """The racer's tokens that are valid, newest first."""
    valid = Q(expiry=None) | Q(expiry__gt=now)
    return get_token_model().objects.filter(valid, user=racer).select_related("grant").order_by("-created")


@audited("token.created", _("API token created"), by="racer")
@transaction.atomic
def create_token(
    *, racer: Racer, now: datetime, scopes: Iterable[str] = SCOPES, days: int | None = None
) -> tuple[AuthToken, str]:
    """A new token and its text, valid for ``days`` or the setting's. Raises UserFault("too_many_tokens")."""
    if tokens_of(racer, now).count() >= TOKENS_PER_RACER:
        raise UserFault("too_many_tokens", limit=TOKENS_PER_RACER)
    get_token_model().objects.filter(user=racer, expiry__lte=now).delete()
    until = timedelta(days=settings.TOKEN_DAYS if days is None else days)
    token, text = get_token_model().objects.create(user=racer, expiry=until)
    TokenGrant.objects.create(token=token, **_columns(scopes))
    return token, text


def scopes_of(token: AuthToken) -> list[str]:
    """What the token may do. One without a grant was made before there were scopes, and may do everything still."""
    grant = getattr(token, "grant", None)
    return grant.scopes if grant else [*SCOPES]


def may_read_secrets(request: Any, scope: str = ORGANISE) -> bool:
    """Whether an answer may contain secrets of the caller: in a session, and with a token of this scope."""
    return request.auth is None or scope in scopes_of(request.auth)


def grant_of(token: AuthToken) -> TokenGrant:
    """The token's grant; one from before there were scopes gets it now."""
    grant = getattr(token, "grant", None)
    return grant or TokenGrant.objects.get_or_create(token=token, defaults=_columns(SCOPES))[0]


def note_use(*, grant: TokenGrant, now: datetime) -> None:
    if grant.last_used_at is not None and now - grant.last_used_at < NOTED_AGAIN_AFTER:
        return
    TokenGrant.objects.filter(pk=grant.pk).update(last_used_at=now)
    grant.last_used_at = now


@audited("token.revoked", _("API token revoked"), target="racer", by="racer")
def revoke_token(*, racer: Racer, key: str) -> bool:
    """Revoke the racer's token that starts with ``key``; False when there is none."""
    return bool(get_token_model().objects.filter(user=racer, token_key=key).delete()[0])


def _columns(scopes: Iterable[str]) -> dict[str, bool]:
    """Raises ValueError for a scope that there is not."""
    chosen = set(scopes)
    if chosen - set(SCOPES):
        raise ValueError(f"no scopes: {sorted(chosen - set(SCOPES))}")
    return {f"may_{scope}": scope in chosen for scope in SCOPES}
