"""The audit log as plain data, CSV and JSON Lines."""

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Annotated, TypedDict, cast

from core.audit.models import AuditEntry

from ..boards import exports


class ChangesByField(TypedDict, total=False):
    """By field: the value before and after."""


class AuditDocument(TypedDict):
    """One act."""

    id: int
    at: str
    action: str
    actor: Annotated[str | None, "null for commands, and once the racer is deleted."]
    actor_id: Annotated[int | None, "Stays when the racer is deleted."]
    channel: str
    program: Annotated[str, "The command, or the first characters of the token."]
    target_kind: str
    target_id: str
    target_name: str
    racer: Annotated[str | None, "Whom the act concerns."]
    racer_id: int | None
    race: Annotated[int | None, "The id of the race that the act concerns."]
    changes: Annotated[ChangesByField, "By field: before and after, null where the values are personal or secret."]
    request: Annotated[str, "The request's id, as in the log of the site."]
    network: Annotated[str, "The client's network, without the last part of the address."]


COLUMNS = tuple(AuditDocument.__annotations__)


def entry_data(entry: AuditEntry, *, in_full: bool = True) -> AuditDocument:
    """``in_full``: with request, program and network, which are for admins."""
    return {
        "id": entry.pk,
        "at": entry.at.isoformat(),
        "action": entry.action,
        "actor": None if entry.actor is None else entry.actor.alias,
        "actor_id": entry.actor_id,
        "channel": entry.channel,
        "program": entry.program if in_full else "",
        "target_kind": entry.target_kind,
        "target_id": entry.target_id,
        "target_name": entry.target_name,
        "racer": None if entry.racer is None else entry.racer.shown_name,
        "racer_id": entry.racer_id,
        "race": entry.race,
        "changes": cast(ChangesByField, entry.changes),
        "request": entry.request if in_full else "",
        "network": entry.network if in_full else "",
    }


def csv_lines(entries: Iterable[AuditEntry]) -> Iterator[str]:
    """The log as CSV, a heading first."""
    rows = (entry_data(entry) | {"changes": json.dumps(entry.changes, ensure_ascii=False)} for entry in entries)
    return exports.csv_lines(COLUMNS, (row.values() for row in rows))


def json_lines(entries: Iterable[AuditEntry]) -> Iterator[str]:
    """The log as JSON Lines."""
    for entry in entries:
        yield json.dumps(entry_data(entry), ensure_ascii=False) + "\n"


Lines = Callable[[Iterable[AuditEntry]], Iterator[str]]
FORMS: dict[str, tuple[str, Lines]] = {
    "csv": ("text/csv; charset=utf-8", csv_lines),
    "jsonl": ("application/x-ndjson", json_lines),
}
