"""Writes the audit log."""

import re
from collections.abc import Callable
from contextvars import ContextVar
from datetime import datetime
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from django.db import transaction
from django.db.models import Model
from django.utils.functional import Promise

from ..validators import without_invisible
from .acting import Acting, acting, current_request
from .acts import AuditAct, register
from .models import AuditEntry

RESULT = "result"
LONGEST = 200  # characters of a value
_UNSHOWN = re.compile(r"password|secret|token|code|invitation|digest|mail|address|key|real_name|guest|alias|terms")
RACER, RACE = "accounts.racer", "races.race"
_PEOPLE = frozenset({RACER, "accounts.classlearner", "account.emailaddress", "races.entry"})
_BESIDE = ("entry", "submission", "event", "round", "session", "lap", "group")  # where a row's race may be found
_inside: ContextVar[bool] = ContextVar("inside_an_act", default=False)

P = ParamSpec("P")
R = TypeVar("R")
Changes = dict[str, list[Any] | None]


def audited(
    name: str, label: str | Promise, *, target: str = RESULT, by: str = "by", unless: str = ""
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator of a service: each call that succeeds is one entry, in the same transaction.

    ``target``: the argument that names the changed row, or :data:`RESULT`; ``by``: the argument with the acting racer,
    else the racer of the request acts; ``unless``: no entry where the target's column of this name is that racer,
    because everybody may do it with their own things. A service that returns False changed nothing. What it does
    through other services belongs to its entry."""
    act = register(AuditAct(name, label))

    def decorate(service: Callable[P, R]) -> Callable[P, R]:
        @wraps(service)
        def recorded(*args: P.args, **kwargs: P.kwargs) -> R:
            doer = None if _inside.get() else acting(kwargs.get(by))
            if doer is None:
                return service(*args, **kwargs)
            mark = _inside.set(True)
            try:
                with transaction.atomic():
                    row = kwargs.get(target)
                    before = stored(row)
                    result = service(*args, **kwargs)
                    row = _row_in(result) if target == RESULT else row
                    race, racer = kwargs.get("race"), kwargs.get("racer")
                    owner = getattr(row, f"{unless}_id", None) if unless else None
                    if isinstance(row, Model) and result is not False and (owner is None or owner != doer.actor):
                        write(act, doer, row, before, race=race, racer=racer)
            finally:
                _inside.reset(mark)
            return result

        recorded.audited = act  # type: ignore[attr-defined]
        return recorded

    return decorate


def record(act: AuditAct, target: Model, *, by: Any = None, changes: Changes | None = None) -> None:
    """Write an entry in the caller's transaction, if somebody acts; for acts that are no call of one service."""
    doer = None if _inside.get() else acting(by)
    if doer is not None:
        write(act, doer, target, changes=changes)


def differences(before: dict[str, object] | None, after: dict[str, object] | None, kind: str) -> Changes:
    """The changed columns of a row; values of persons and of secrets are left out."""
    if before is None or after is None:
        return {}
    changed = {name: [before.get(name), value] for name, value in after.items() if before.get(name) != value}
    return {name: None if _is_hidden(kind, name, pair) else [*map(_plain, pair)] for name, pair in changed.items()}


def columns_of(row: Model) -> dict[str, object]:
    """The row's loaded columns by name."""
    return {field.attname: getattr(row, field.attname) for field in row._meta.concrete_fields}


def written(row: Model) -> bool:
    """Whether this request has an entry of this row already."""
    return _key(row) in getattr(current_request.get(), "audited", ())


def write(
    act: AuditAct,
    doer: Acting,
    row: Model,
    before: dict[str, object] | None = None,
    *,
    race: Any = None,
    racer: Any = None,
    changes: Changes | None = None,
) -> None:
    """Write one entry. ``before``: the row's columns before the act; ``changes``: instead of working them out."""
    kind, number = _key(row, before)
    if changes is None:
        changes = differences(before, stored(row), kind)
    AuditEntry.objects.create(
        action=act.name,
        actor_id=doer.actor,
        channel=doer.channel,
        program=doer.program,
        target_kind=kind,
        target_id=number[:64],
        target_name=_name(row, kind),
        racer_id=_id_of(racer) or (row.pk if kind == RACER else _found(row, "racer", RACER)),
        race=_id_of(race) or (row.pk if kind == RACE else _found(row, "race", RACE)),
        changes=changes,
        request=doer.request,
        network=doer.network,
    )
    request = current_request.get()
    if request is not None:
        request.__dict__.setdefault("audited", set()).add((kind, number))


def _key(row: Model, before: dict[str, object] | None = None) -> tuple[str, str]:
    number = row.pk if row.pk is not None else (before or {}).get("id", "")  # deleted: Django forgets the key
    return row._meta.label_lower, str(number)


def _is_hidden(kind: str, name: str, pair: list[Any]) -> bool:
    if all(isinstance(value, bool) for value in pair):
        return False
    return kind in _PEOPLE or _UNSHOWN.search(name) is not None


def _row_in(result: Any) -> Model | None:
    """The row that a service returned, alone or as the first of several."""
    if isinstance(result, Model):
        return result
    for one in result if isinstance(result, tuple | list) else vars(result).values() if _is_plain(result) else ():
        if isinstance(one, Model):
            return one
        if _is_plain(one) and (inner := _row_in(one)) is not None:
            return inner
    return None


def _is_plain(value: Any) -> bool:
    return hasattr(value, "__dataclass_fields__")


def stored(row: Any) -> dict[str, object] | None:
    """What the database holds of a row; None for none."""
    if not isinstance(row, Model) or row.pk is None:
        return None
    stored = row._meta.model._base_manager.filter(pk=row.pk).first()  # its type may be that of a lazy request.user
    return None if stored is None else columns_of(stored)


def _name(row: Model, kind: str) -> str:
    if kind in _PEOPLE:
        return ""
    for name in ("slug", "public_id", "name"):
        if value := getattr(row, name, None):
            return without_invisible(str(value))[:100]
    return ""


def _id_of(row: Any) -> int | None:
    return row.pk if isinstance(row, Model) else None


def _found(row: Any, name: str, kind: str) -> int | None:
    """The id of a row of ``kind`` that the row, or one that it belongs to, points to by ``name``."""
    for _step in range(3):
        field = next((one for one in row._meta.concrete_fields if one.name == name), None)
        if (
            field is not None
            and field.related_model is not None
            and field.related_model._meta.label_lower == kind
            and (value := getattr(row, field.attname)) is not None
        ):
            return value
        row = next((found for near in _BESIDE if isinstance(found := getattr(row, near, None), Model)), None)
        if row is None:
            break
    return None


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float):
        return value
    text = value.isoformat(timespec="seconds") if isinstance(value, datetime) else str(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
