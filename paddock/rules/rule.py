"""What one entry of a list says: a parameter in the field's terms, with all that forms, commands and pages need."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, get_args, get_type_hints


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


def pgettext_noop(context: str, text: str) -> str:
    """The same for a text that means several things: ``context`` tells which."""
    return text


@dataclass(frozen=True)
class Rule:
    """One parameter.

    ``label`` and ``help`` are marked for translation; ``short`` is the label where there is little room. ``unit``: "ms"
    (told in seconds on pages), "m" or "m/s". ``least`` and ``most`` are what a race may ask; ``beyond``: a run takes
    more than that, as long as it makes sense (environments and commands use it). ``unlimited``: the value that means
    no limit; ``optional``: None means that. ``choices``: the only values. ``race_types``: those that it says something
    to, all if empty.

    ``layout``: it says what stands and drives on the track. ``run_only``: a run takes it, an organiser cannot set it.
    ``fixed``: it does not change any more once a car was sent. ``stage``: a season sets it for its stages. ``column``:
    a row has a column for it, because a query or a constraint needs one; otherwise it stands in the row's ``rules``.
    ``added``: since the first release, so that the database itself knows the column's default.

    ``episode``: the default of an environment, where it is another; ``proposed``: what a form fills in where the
    default is none. ``place``: in the order of forms and pages. ``option``: what the command line calls it, where that
    is not the name. ``context``: of the label for translators. A default of None: it
    may be left out.
    """

    name: str
    type: type
    default: Any
    label: str = ""
    short: str = ""
    help: str = ""
    unit: str = ""
    least: float | None = None
    most: float | None = None
    beyond: bool = False
    unlimited: int | None = None
    optional: bool = False
    choices: tuple[str, ...] = ()
    race_types: tuple[str, ...] = ()
    layout: bool = False
    run_only: bool = False
    fixed: bool = True
    stage: bool = False
    column: bool = False
    added: bool = False
    episode: Any = None
    proposed: Any = None
    place: int = 99
    option: str = ""
    context: str = ""

    @property
    def default_of_an_episode(self) -> Any:
        """What an environment takes where nobody says otherwise."""
        return self.default if self.episode is None else self.episode

    @property
    def bounds(self) -> tuple[float, float]:
        """What a race may ask, of a rule that has bounds."""
        assert self.least is not None and self.most is not None, self.name
        return self.least, self.most

    @property
    def range(self) -> str:
        """The bounds in words; empty without any."""
        if self.least is None or self.most is None:
            return ""
        return f"{self.least:g} to {self.most:g}" if self.most < 2**31 - 1 else f"at least {self.least:g}"

    def belongs_to(self, race_type: str) -> bool:
        """Whether it says something to races of this type."""
        return not self.race_types or race_type in self.race_types

    def check(self, value: object) -> None:
        """Refuse a value that makes no sense. Raises ValueError, which names the rule and what is possible."""
        if value is None and (self.default is None or self.optional):
            return
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"{self.name} must be one of {self.choices}, not {value!r}")
        elif self.type is bool:
            if not isinstance(value, bool):
                raise ValueError(f"{self.name} must be true or false, not {value!r}")
        elif self.type is int:
            self._check_whole(value)
        elif self.type is float:
            least, most = (0.0, float("inf")) if self.beyond else (self.least or 0.0, self.most)
            if not _is_number(value, int | float) or not least <= value <= most:  # type: ignore[operator]
                raise ValueError(f"{self.name} must be a number from {least} to {most}, not {value!r}")

    def _check_whole(self, value: object) -> None:
        least = int(self.least or 0)
        least = min(least, 1, self.default) if self.beyond else least
        if not _is_number(value, int) or value < least:  # type: ignore[operator]
            raise ValueError(f"{self.name} must be a whole number of at least {least}, not {value!r}")
        if not self.beyond and self.most is not None and value > self.most:  # type: ignore[operator]
            raise ValueError(f"{self.name} must be at most {self.most:g}, not {value!r}")


def rule(default: Any, **said: Any) -> Any:
    """A field of a dataclass that is an entry of a list; ``said``: what :class:`Rule` has besides name and type."""
    return dataclasses.field(default=default, metadata={"rule": said})


def rules_in(kind: type) -> Mapping[str, Rule]:
    """The entries of a dataclass, its fields that are made with :func:`rule`, by their names in the order written."""
    types = get_type_hints(kind)
    return MappingProxyType(
        {
            field.name: Rule(field.name, _plain(types[field.name]), field.default, **field.metadata["rule"])
            for field in dataclasses.fields(kind)
            if "rule" in field.metadata
        }
    )


def _plain(kind: Any) -> Any:
    """The type of a value that is not None."""
    kinds = get_args(kind)
    return kinds[0] if type(None) in kinds else kind


def _is_number(value: object, kind: Any) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)
