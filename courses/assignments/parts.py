"""Checks of the parts of an assignment, and their rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, NotRequired, TypedDict, cast

from django.core.exceptions import ValidationError

from paddock.errors import UserFault
from paddock.rules.race import OWN_RULES, RULES, RaceRules
from races.errors import RaceRefused, problem
from races.test_runs.rules import own_rules
from tracks.models import Track

from ..marking.facts import PassParams
from ..marking.pass_rules import PASS_RULES, PassRule
from ..models import Assignment, AssignmentPart, PartTrack, TrackKind

MOST_PARTS, MOST_TRACKS, MOST_IN_ALL = 20, 20, 40


class PartValues(TypedDict):
    """A part to be checked. ``tracks``: pairs of a track and a kind."""

    title: str
    points: Decimal
    pass_rule: str
    pass_params: NotRequired[Mapping[str, object]]
    rules: NotRequired[RaceRules | Mapping[str, object]]
    tracks: NotRequired[Sequence[tuple[Track, str]]]
    hidden_tracks: NotRequired[int]


@dataclass(frozen=True)
class CheckedPart:
    """A part that is ready to be stored."""

    title: str
    points: Decimal
    pass_rule: str
    pass_params: PassParams
    rules: dict[str, object]
    tracks: tuple[tuple[int, str], ...]
    hidden_tracks: int

    @property
    def driven(self) -> tuple[Any, ...]:
        """What is driven: it cannot change after the first attempt."""
        return RaceRules.from_dict(self.rules), self.tracks, self.hidden_tracks


def checked_parts(parts: Iterable[PartValues]) -> list[CheckedPart]:
    """The parts with their defaults. Raises ValidationError and UserFault."""
    parts = list(parts)
    if len(parts) > MOST_PARTS:
        raise problem("assignment_too_many_parts", limit=MOST_PARTS)
    if sum(len(part.get("tracks", ())) for part in parts) > MOST_IN_ALL:
        raise problem("assignment_too_many_tracks_in_all", limit=MOST_IN_ALL)
    return [_checked(number, part) for number, part in enumerate(parts, 1)]


def _checked(number: int, part: PartValues) -> CheckedPart:
    rules = _race_rules(part.get("rules", {}))
    tracks = list(part.get("tracks", ()))
    hidden = part.get("hidden_tracks", 0)
    _check_tracks(number, tracks, hidden)
    for track, _kind in tracks:
        own_rules(track, _options(rules))
    rule = PASS_RULES.get(part["pass_rule"])
    if rule is None:
        raise problem("assignment_pass_rule", rule=str(part["pass_rule"]))
    points = Decimal(str(part["points"]))
    return CheckedPart(
        title=part["title"],
        points=points,
        pass_rule=rule.code,
        pass_params=_params(rule, part.get("pass_params", {}), points, rules),
        rules=rules.to_dict(),
        tracks=tuple((track.pk, str(kind)) for track, kind in tracks),
        hidden_tracks=hidden,
    )


def _race_rules(given: RaceRules | Mapping[str, object]) -> RaceRules:
    if isinstance(given, RaceRules):
        return given
    try:
        return RaceRules.from_dict(given)
    except (TypeError, ValueError, KeyError) as error:
        raise problem("assignment_rules", problem=str(error)) from error


def _options(rules: RaceRules) -> dict[str, object]:
    """Rules as options of a run (:func:`races.test_runs.rules.own_rules`)."""
    values = rules.to_dict()
    options = {name: getattr(rules, name) for name in OWN_RULES if name in RULES and hasattr(rules, name)}
    return options | {"boxes": [dict(box) for box in values["boxes"]], "start_m": rules.start_m}


def _check_tracks(number: int, tracks: Sequence[tuple[Track, str]], hidden: int) -> None:
    if not tracks:
        raise problem("assignment_no_tracks", number=number)
    if len(tracks) > MOST_TRACKS:
        raise problem("assignment_too_many_tracks", limit=MOST_TRACKS)
    if len({track.pk for track, _kind in tracks}) < len(tracks):
        raise problem("assignment_track_twice", number=number)
    candidates = sum(kind != TrackKind.SHOWN for _track, kind in tracks)
    if candidates < hidden or (candidates and not hidden):
        raise problem("assignment_candidates")


def _params(rule: PassRule, given: Mapping[str, object], points: Decimal, rules: RaceRules) -> PassParams:
    values = {**rule.default_params(), **given}
    known = {one.name: one for one in rule.params}
    for name, value in values.items():
        if name not in known:
            raise problem("assignment_value_name", name=name)
        if code := known[name].problem(value):
            raise problem(code, name=name, least=known[name].least, most=known[name].most)
    params = cast(PassParams, values)
    if any(Decimal(str(one["points"])) > points for one in params.get("thresholds", ())):
        raise problem("assignment_threshold_points")
    if rule.uses_laps(params) and params["laps"] > rules.laps:
        raise problem("assignment_laps", needed=params["laps"], laps=rules.laps)
    if "thresholds" in params:
        times = sorted(params["thresholds"], key=lambda one: one["at_most_ms"])
        params["thresholds"] = [{"at_most_ms": one["at_most_ms"], "points": _in_cents(one["points"])} for one in times]
    return params


def _in_cents(points: Any) -> str:
    """Points as marks have them, without needless zeros, however they were written: ``1e-99999`` would fill pages."""
    return f"{round(Decimal(str(points)), 2).normalize():f}"


def stored_parts(assignment: Assignment) -> list[CheckedPart]:
    """The parts as they are; drawn tracks as the candidates that they were."""
    shown = {TrackKind.DRAWN: TrackKind.CANDIDATE}
    return [
        CheckedPart(
            title=part.title,
            points=part.points,
            pass_rule=part.pass_rule,
            pass_params=part.pass_params,
            rules=part.rules,
            tracks=tuple((one.track_id, str(shown.get(TrackKind(one.kind), one.kind))) for one in part.tracks.all()),
            hidden_tracks=part.hidden_tracks,
        )
        for part in assignment.parts.prefetch_related("tracks")
    ]


def write_parts(assignment: Assignment, parts: Sequence[CheckedPart], *, driven: bool) -> None:
    """Replace the parts; with ``driven`` only what is not driven."""
    if not driven:
        assignment.parts.all().delete()
    rows = {part.number: part for part in assignment.parts.all()}
    for number, part in enumerate(parts, 1):
        row = rows.get(number) or AssignmentPart(assignment=assignment, number=number)
        row.title, row.points = part.title, part.points
        row.pass_rule, row.pass_params = part.pass_rule, part.pass_params
        row.rules, row.hidden_tracks = part.rules, part.hidden_tracks
        row.full_clean(exclude=["assignment"])
        row.save()
        if not driven:
            PartTrack.objects.bulk_create(
                PartTrack(part=row, track_id=track, number=at, kind=kind)
                for at, (track, kind) in enumerate(part.tracks, 1)
            )


def refused_at(field: str, fault: UserFault | ValidationError) -> UserFault:
    """A refusal with its problems beside a field of the assignment."""
    found = fault.errors if isinstance(fault, RaceRefused) else fault
    if isinstance(found, ValidationError):
        by_field = found.error_dict.values() if hasattr(found, "error_dict") else [found.error_list]
        return RaceRefused(ValidationError({field: [one for errors in by_field for one in errors]}))
    assert isinstance(fault, UserFault), "what is no ValidationError"
    return RaceRefused(ValidationError({field: problem(fault.code, **fault.params)}))
