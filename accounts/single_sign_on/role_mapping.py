"""Which groups of a provider give which roles: PADDOCK_SSO_GROUPS."""

# Roles that are marks of the account, the greatest last
STANDINGS = ("steward", "admin")
# Roles that are a racer's own quota: its name and limit
QUOTAS = {"teacher": ("learners", 120), "organiser": ("races", 100)}
# Before the name of a group of permissions of the admin site
PERMISSIONS = "group:"


def roles_in(text: str) -> tuple[tuple[str, str], ...]:
    """Pairs of a group (in lower case) and a role, of ``group=role,group=role``. Raises ValueError."""
    pairs = []
    for pair in filter(None, (part.strip() for part in text.split(","))):
        group, _, role = (part.strip() for part in pair.rpartition("="))
        if not group:
            raise ValueError(f"{pair!r} names no group")
        is_permissions = role.startswith(PERMISSIONS) and role != PERMISSIONS
        if role not in (*STANDINGS, *QUOTAS) and not is_permissions:
            raise ValueError(f"{role!r} is none of {', '.join((*STANDINGS, *QUOTAS))} and {PERMISSIONS}NAME")
        pairs.append((group.casefold(), role))
    return tuple(pairs)
