"""Roles that a provider's groups give and take at each log-in."""

import logging
from collections.abc import Collection

from django.conf import settings
from django.contrib.auth.models import Group
from django.db import transaction
from django.utils.translation import gettext_lazy as _

from core.audit.acts import AuditAct, register
from core.audit.recording import record

from ..models import Racer
from ..quotas import limit_of
from .role_mapping import PERMISSIONS, QUOTAS, STANDINGS

logger = logging.getLogger(__name__)
ROLES_SET = register(AuditAct("racer.roles_set", _("Roles set by single sign-on")))


@transaction.atomic
def apply_roles(*, racer: Racer, groups: Collection[str]) -> list[str]:
    """Give the racer the roles of these groups and take the other roles that PADDOCK_SSO_GROUPS names; roles that it
    does not name stay. Returns what changed, as ``+role`` and ``-role``."""
    held = {group.casefold() for group in groups}
    wanted: dict[str, bool] = {}
    for group, role in settings.SSO_ROLES:
        wanted[role] = wanted.get(role, False) or group in held
    changes = _stand(racer, wanted)
    for role, is_wanted in wanted.items():
        if role in QUOTAS:
            changed = _limit(racer, *QUOTAS[role], is_wanted)
        elif role.startswith(PERMISSIONS):
            changed = _permit(racer, role.removeprefix(PERMISSIONS), is_wanted)
        else:
            continue
        if changed:
            changes.append(f"{'+' if is_wanted else '-'}{role}")
    if changes:
        logger.warning("Single sign-on changed the roles of %s: %s", racer.alias, " ".join(changes))
        record(ROLES_SET, racer, by=racer, changes={"roles": ["", " ".join(changes)]})
    return changes


def standing_of(racer: Racer) -> str:
    """The role that is a mark of the account: admin, steward or none."""
    return "admin" if racer.is_staff and racer.is_superuser else "steward" if racer.is_staff else ""


def _stand(racer: Racer, wanted: dict[str, bool]) -> list[str]:
    ranks = ("", *STANDINGS)
    before = standing_of(racer)
    after = max((role for role in STANDINGS if wanted.get(role)), key=ranks.index, default="")
    if before and before not in wanted:  # given by hand
        after = max(before, after, key=ranks.index)
    if after == before:
        return []
    racer.is_staff, racer.is_superuser = bool(after), after == "admin"
    racer.save(update_fields=["is_staff", "is_superuser"])
    return [f"-{before}"] * bool(before) + [f"+{after}"] * bool(after)


def _limit(racer: Racer, name: str, limit: int, is_wanted: bool) -> bool:
    """A quota that an admin has set stays: only one of exactly this limit is taken back."""
    own = racer.quotas.filter(name=name)
    if not is_wanted:
        return bool(own.filter(limit=limit).delete()[0])
    if own.exists() or limit_of(racer, name) >= limit:
        return False
    return bool(own.create(racer=racer, name=name, limit=limit))


def _permit(racer: Racer, name: str, is_wanted: bool) -> bool:
    is_in = racer.groups.filter(name=name).exists()
    if is_in == is_wanted:
        return False
    if is_wanted:
        racer.groups.add(Group.objects.get_or_create(name=name)[0])
    else:
        racer.groups.remove(Group.objects.get(name=name))
    return True
