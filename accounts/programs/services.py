"""Writes of programs' accounts and of their tokens."""

from collections.abc import Iterable
from datetime import datetime

from django.db import IntegrityError, transaction
from django.db.models import Max, QuerySet
from django.utils.translation import gettext_lazy as _
from knox.models import AuthToken

from core.audit.recording import audited
from paddock.errors import UserFault

from ..models import Racer, ServiceAccount, Viewer
from ..models.program import PREFIX
from ..tokens.services import create_token, revoke_token


def can_manage_programs(viewer: Viewer) -> bool:
    """Whether the viewer may make and change programs: admins with the permission, and no program."""
    if not isinstance(viewer, Racer) or not viewer.is_staff or viewer.is_program:
        return False
    return viewer.has_perm("accounts.add_serviceaccount")


def programs() -> QuerySet[ServiceAccount]:
    """All programs by alias, with ``last_used_at``."""
    used = Max("racer__auth_token_set__grant__last_used_at")
    accounts = ServiceAccount.objects.select_related("racer", "owner").annotate(last_used_at=used)
    return accounts.order_by("racer__alias")


@audited("program.created", _("Program created"))
def make_program(*, by: Racer, name: str, purpose: str, owner: str, now: datetime) -> ServiceAccount:
    """An account without tokens. ``owner``: an alias. Raises UserFault("program_not_yours" | "program_name_taken" |
    "program_owner_unknown") and ValidationError by field."""
    _require(by)
    alias = PREFIX + name.strip().lower().removeprefix(PREFIX)
    if Racer.objects.filter(alias__iexact=alias).exists():
        raise UserFault("program_name_taken")
    racer = Racer(alias=alias, email=f"{alias}@program.invalid", is_program=True, joined_at=now)
    racer.set_unusable_password()
    program = ServiceAccount(racer=racer, owner=_owner(owner), purpose=purpose.strip(), made_at=now)
    racer.full_clean(exclude={"password"})
    program.clean_fields(exclude={"racer"})
    try:
        with transaction.atomic():
            racer.save(force_insert=True)
            program.save(force_insert=True)
    except IntegrityError:
        raise UserFault("program_name_taken") from None
    return program


@audited("program.changed", _("Program changed"), target="program")
def change_program(
    *, program: ServiceAccount, by: Racer, purpose: str | None = None, owner: str | None = None
) -> ServiceAccount:
    """Another purpose or owner. Raises as :func:`make_program`."""
    _require(by)
    if purpose is not None:
        program.purpose = purpose.strip()
    if owner is not None:
        program.owner = _owner(owner)
    program.clean_fields(exclude={"racer"})
    program.save(update_fields=["purpose", "owner"])
    return program


def switch_program(*, program: ServiceAccount, by: Racer, active: bool) -> ServiceAccount:
    """Disable a program, so that its tokens are refused, or enable it again. Raises
    UserFault("program_not_yours" | "program_owner_unknown")."""
    _require(by)
    if active and (program.owner is None or not program.owner.is_active):
        raise UserFault("program_owner_unknown")
    return (_enable if active else _disable)(program=program, by=by)


@audited("program.disabled", _("Program disabled"), target="program")
def _disable(*, program: ServiceAccount, by: Racer) -> ServiceAccount:
    return _set_active(program, False)


@audited("program.enabled", _("Program enabled"), target="program")
def _enable(*, program: ServiceAccount, by: Racer) -> ServiceAccount:
    return _set_active(program, True)


def disable_programs_of(*, owner: Racer) -> int:
    """Disable the programs of a deactivated owner. Returns their number."""
    return Racer.objects.filter(program__owner=owner, is_active=True).update(is_active=False)


@audited("program.token_created", _("Token of a program created"), target="program")
@transaction.atomic
def make_program_token(
    *, program: ServiceAccount, by: Racer, scopes: Iterable[str], days: int, now: datetime
) -> tuple[AuthToken, str]:
    """A token and its text. Raises UserFault("program_not_yours" | "program_disabled" | "too_many_tokens")."""
    _require(by)
    if not program.racer.is_active:
        raise UserFault("program_disabled")
    return create_token(racer=program.racer, now=now, scopes=scopes, days=days)


@audited("program.token_replaced", _("Token of a program replaced"), target="program")
@transaction.atomic
def replace_program_token(
    *, program: ServiceAccount, by: Racer, key: str, days: int, now: datetime
) -> tuple[AuthToken, str] | None:
    """A new token of the same scopes in place of the one that starts with ``key``; None when there is none."""
    _require(by)
    old = AuthToken.objects.filter(user=program.racer, token_key=key).select_related("grant").first()
    if old is None:
        return None
    scopes = old.grant.scopes
    revoke_token(racer=program.racer, key=key)
    return make_program_token(program=program, by=by, scopes=scopes, days=days, now=now)


@audited("program.token_revoked", _("Token of a program revoked"), target="program")
def revoke_program_token(*, program: ServiceAccount, by: Racer, key: str) -> bool:
    """Revoke one of the program's tokens; False when there is none."""
    _require(by)
    return revoke_token(racer=program.racer, key=key)


def _set_active(program: ServiceAccount, active: bool) -> ServiceAccount:
    program.racer.is_active = active
    program.racer.save(update_fields=["is_active"])
    return program


def _owner(alias: str) -> Racer:
    people = Racer.objects.filter(is_active=True, is_house=False, is_program=False, learner=None)
    racer = people.filter(alias__iexact=alias.strip()).first()
    if racer is None:
        raise UserFault("program_owner_unknown")
    return racer


def _require(by: Racer) -> None:
    if not can_manage_programs(by):
        raise UserFault("program_not_yours")
