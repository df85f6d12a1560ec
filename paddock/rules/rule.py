"""The definition of one parameter, with everything that forms, commands and pages need."""

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, get_args, get_type_hints


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


def pgettext_noop(context: str, text: str) -> str:
    return text


@dataclass(frozen=True)
class Rule:
    """One parameter.

    ``label`` and ``help`` are marked for translation; ``short`` is a shorter label. ``unit``: "ms" (seconds on pages),
    "m" or "m/s". ``least`` and ``most``: the range of a race; ``beyond``: runs (environments, commands) take any
    sensible value. ``unlimited``: the value that means no limit; ``optional``: None means no limit. ``choices``: the
    only values. ``race_types``: where it applies, all if empty.

    ``layout``: it defines the objects on the track. ``run_only``: organisers cannot set it. ``fixed``: it is final
    after the first submission. ``stage``: a season sets it for its stages. ``column``: a row has a column for it, else
    it is in the row's ``rules``. ``added``: since the first release, so that the column has a default in the database.

    ``episode``, ``of_a_stage``: another default for environments and for stages of a season; ``proposed``: the
    initial value of forms without a default. ``place``: in the order of forms and pages. ``option``: its name on the
    command line, if another. ``context``: of the label for translators. A default of None: it may be left out.
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
    choices: Collection[str] = ()
    race_types: tuple[str, ...] = ()
    layout: bool = False
    run_only: bool = False
    fixed: bool = True
    stage: bool = False
    column: bool = False
    added: bool = False
    episode: Any = None
    proposed: Any = None
    of_a_stage: Any = None
    place: int = 99
    option: str = ""
    context: str = ""

    @property
    def default_of_an_episode(self) -> Any:
        return self.default if self.episode is None else self.episode

    @property
    def default_of_a_stage(self) -> Any:
        """The initial value of a season's form for its stages."""
        values = (self.of_a_stage, self.proposed, self.default)
        return next((value for value in values if value is not None), None)

    @property
    def bounds(self) -> tuple[float, float]:
        assert self.least is not None and self.most is not None, self.name
        return self.least, self.most

    @property
    def range(self) -> str:
        """The bounds in words; empty without any."""
        if self.least is None or self.most is None:
            return ""
        return f"{self.least:g} to {self.most:g}" if self.most < 2**31 - 1 else f"at least {self.least:g}"

    def belongs_to(self, race_type: str) -> bool:
        return not self.race_types or race_type in self.race_types

    def check(self, value: object) -> None:
        """Raises ValueError for an invalid value, with the name of the rule and the possible values."""
        if value is None and (self.default is None or self.optional):
            return
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"{self.name} must be one of {tuple(self.choices)}, not {value!r}")
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


def rule(default: Any, *, between: tuple[float, float] | None = None, **attributes: Any) -> Any:
    """A field of a dataclass that is a :class:`Rule`. ``between``: its ``least`` and ``most``."""
    if between is not None:
        attributes["least"], attributes["most"] = between
    return dataclasses.field(default=default, metadata={"rule": attributes})


def rules_in(kind: type) -> Mapping[str, Rule]:
    """The rules of a dataclass by their names in the order of its fields."""
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
