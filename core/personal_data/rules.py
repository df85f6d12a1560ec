"""The registry of rules on personal data."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from django.db.models import Model, Q, QuerySet
from django.utils.module_loading import autodiscover_modules

from .retention import RetentionPolicy

# Reasons that several rooms give.
NOBODY = "It names no person."
OF_THE_RACE = "It belongs to the race and to all its racers."
OTHERS = "It names other people."
SECRET = "It is a secret, or a digest of one."
NEEDED = "It proves an official result, and names nobody."


@dataclass(frozen=True)
class PersonalData:
    """The rules of one model; columns are named in one text, separated by blanks.

    Deleting an account: ``rows``: the owner's rows go whole; ``erased``: columns that are emptied; ``anonymised``: they
    stay and point to the account without its name; ``kept``: a reason and its columns. ``mentions``: columns of
    anybody's rows that may quote an alias or an e-mail address, which is replaced there.

    The racer's download: ``owner``: the ways to the racer, none for what belongs to nobody; ``section``: the file in
    the archive, none for ``""``; ``exported``: columns of the owner's rows (those that need no rule are there as well);
    ``withheld``: a reason and its columns, or ``*``; ``files``: the names of stored files besides those in columns."""

    model: type[Model]
    owner: str = ""
    rows: bool = False
    erased: str = ""
    anonymised: str = ""
    kept: Mapping[str, str] = field(default_factory=dict)
    mentions: str = ""
    section: str = ""
    exported: str = ""
    withheld: Mapping[str, str] = field(default_factory=dict)
    files: Callable[[Any], Iterable[str]] | None = None

    @property
    def export_rules(self) -> list[str]:
        """Each column that the download has or withholds, once for each rule."""
        return " ".join((self.exported, *self.withheld.values())).split()

    def is_owned_by(self, racer: Model) -> Q:
        """The condition of rows that belong to a racer."""
        ways = Q(pk__in=[])
        for way in self.owner.split():
            ways |= Q(**{way: racer.pk})
        return ways

    def owned_by(self, racer: Model) -> QuerySet[Model]:
        """The rows that belong to a racer."""
        return self.model._base_manager.filter(self.is_owned_by(racer))


@dataclass(frozen=True)
class Leaving:
    """A racer during the deletion of the account, with all their names in the database."""

    racer: Any
    now: datetime
    names: frozenset[str]  # the aliases, past ones as well, and e-mail addresses
    nameless: str  # the alias that takes their place


@dataclass(frozen=True)
class Room:
    """The rules of a room in the order in which rows are erased. ``check``: raises UserFault for a racer who must do
    something before they can leave; ``erase``: removes what the rules cannot; ``policies``: how long data are kept."""

    rules: tuple[PersonalData, ...]
    check: Callable[[Any, datetime], None] | None = None
    erase: Callable[[Leaving], None] | None = None
    policies: tuple[RetentionPolicy, ...] = ()


_rooms: dict[str, Room] = {}


def register(
    room: str,
    *rules: PersonalData,
    check: Callable[[Any, datetime], None] | None = None,
    erase: Callable[[Leaving], None] | None = None,
    policies: Iterable[RetentionPolicy] = (),
) -> None:
    """Make the rules of a room known. Registering them again replaces them."""
    _rooms[room] = Room(rules, check, erase, tuple(policies))


def all_rooms() -> list[Room]:
    """The rules of all rooms, from the highest room down."""
    autodiscover_modules("personal_data")
    from . import of_core  # noqa: F401 - below every other room

    return list(_rooms.values())


def all_rules() -> dict[str, PersonalData]:
    """All rules by the label of their model."""
    return {rule.model._meta.label: rule for room in all_rooms() for rule in room.rules}


def all_policies() -> list[RetentionPolicy]:
    """The retention policies of all rooms by name."""
    return sorted((policy for room in all_rooms() for policy in room.policies), key=lambda policy: policy.name)
