"""Short descriptions of a race for its card, page and rules, in the reader's language."""

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from core.times import clock, gap
from evaluation.models import Evaluation
from evaluation.templatetags.garage import SENSOR_WORDS
from paddock.rules.race import BY_PLACE, OF_ENTERING, RULES, RaceRules

from ..boards.ranking import rule_for, standing_in
from ..boards.selectors.results import Place, Rival
from ..models import DuelFormat, Entry, Opponents, Race
from ..models.rule_labels import figures
from ..models.sensors import OFFERABLE


def layout_facts(race: Race) -> list[str]:
    """Short texts on boxes and other cars on the track; none for an empty track."""
    boxes = len(race.boxes) or race.random_boxes
    if boxes:
        facts = [ngettext("%(count)s box", "%(count)s boxes", boxes) % {"count": boxes}]
        if race.random_boxes:
            facts.append(_("drawn from the seed"))
        return facts
    if race.opponents == Opponents.BOTS:
        bots = ngettext("%(count)s bot at %(speed)s m/s", "%(count)s bots at %(speed)s m/s", race.bots)
        facts = [bots % {"count": race.bots, "speed": f"{race.bot_speed_mps:g}"}]
        if race.bot_lane_changes:
            facts.append(_("changing lanes"))
        return facts
    if race.opponents == Opponents.MODELS:
        return [
            _("car against car") if race.duel_cars == 2 else _("%(cars)s cars at once") % {"cars": race.duel_cars},
            race.get_duel_format_display(),
        ]
    return []


def sensor_words(race: Race) -> list[str]:
    """The sensors that a race offers, one word for all of them."""
    if set(race.sensors) == set(OFFERABLE):
        return [_("all sensors")]
    return [_(SENSOR_WORDS.get(name, name)) for name in race.sensors]


def layout_rules(race: Race) -> list[str]:
    """Rules of obstacles in whole sentences: those on the track, and the effect of a crash."""
    if race.boxes or race.random_boxes:
        rules = _box_rules(race)
    elif race.opponents == Opponents.BOTS:
        rules = _bot_rules(race)
    elif race.opponents == Opponents.MODELS:
        rules = _duel_rules(race)
    else:
        return []
    return [*rules, _crash_rule(race)]


def fault_words(race: Race) -> str:
    if race.physical:
        return " ".join(_physical_faults(race))
    if not race.max_resets:
        return _("The first fault ends the run.")
    sentences = [
        _("Off track: back on the lane after %(seconds)s s.") % {"seconds": f"{race.off_track_penalty_ms / 1000:g}"}
    ]
    if layout_facts(race):
        sentences.append(_("A crash costs %(seconds)s s.") % {"seconds": f"{race.collision_penalty_ms / 1000:g}"})
    return " ".join(sentences)


def fault_rules(race: Race) -> list[str]:
    """The effect of leaving the road, in whole sentences."""
    if race.physical:
        return [
            _("The clock begins when the timekeeper starts it, or with the first crossing that a sensor sees."),
            *_physical_faults(race),
        ]
    resets = race.max_resets
    standing = (
        [
            _(
                "Laps are not driven in a row: after each one the car is put back to the start, and the next begins "
                "from rest."
            )
        ]
        if race.standing_laps
        else []
    )
    if not resets:
        return [*standing, _("No resets: the first fault ends the run.")]
    rules = [
        *standing,
        _(
            "A car that is off track or drives backwards restarts on the nearer lane after "
            "%(seconds)s s. The clock keeps running."
        )
        % {"seconds": f"{race.off_track_penalty_ms / 1000:g}"},
    ]
    if resets != RULES["max_resets"].unlimited:
        allowed = ngettext(
            "%(resets)s reset is allowed; the next fault ends the run.",
            "%(resets)s resets are allowed; the next fault ends the run.",
            resets,
        )
        rules.append(allowed % {"resets": resets})
    return rules


def _physical_faults(race: Race) -> list[str]:
    """The cost of faults for real cars, in whole sentences."""
    sentences = []
    if race.off_track_penalty_ms:
        seconds = f"{race.off_track_penalty_ms / 1000:g}"
        sentences.append(_("Each off track adds %(seconds)s s to the lap.") % {"seconds": seconds})
    if race.max_resets != RULES["max_resets"].unlimited:
        text = ngettext(
            "A lap with more than %(resets)s reset is invalid.",
            "A lap with more than %(resets)s resets is invalid.",
            race.max_resets,
        )
        sentences.append(text % {"resets": race.max_resets})
    return sentences


# Rules shown in other places or in their own wording.
_SHOWN_ELSEWHERE = ("race_type", "direction", "sensors", "ranking_method", "seed", *OF_ENTERING)
_IN_FIGURES = tuple(name for name in BY_PLACE if not RULES[name].layout and name not in _SHOWN_ELSEWHERE)


def rule_figures(race: Race) -> list[tuple[str, str]]:
    """Label and value of the rules that every race of this type has."""
    return figures(race, _IN_FIGURES)


def score_words(entry: Entry) -> str:
    """An entry's score as text: a time, points, or in a bracket ties won; a dash for unclassified entries."""
    if entry.seed is None:
        return clock(entry.score_ms)
    if entry.race.duel_format == DuelFormat.BRACKET:
        return ngettext("%(count)s duel won", "%(count)s duels won", entry.points) % {"count": entry.points}
    return ngettext("%(count)s point", "%(count)s points", entry.points) % {"count": entry.points}


def score_name(race: Race) -> str:
    return rule_for(race).name(race)


def worth_words(run: Evaluation) -> tuple[str, str] | None:
    """The result of a run by its ranking, and its label; None before it has a result."""
    result, submission = getattr(run, "result", None), getattr(run, "submission", None)
    if result is None:
        return None
    if submission is not None:
        race = submission.entry.race
        standing = standing_in(race, result.laps)
        return clock(standing.score_ms), score_name(race) if standing.classified else _("not classified")
    if getattr(run, "duel", None) is not None:
        place = _("place %(place)s of %(cars)s")
        return place % {"place": result.order.index(0) + 1, "cars": len(result.order)}, _("in a heat")
    return clock(result.best_lap_ms), _("Best lap")


def pace(place: Place) -> str:
    """How a house car, which has no rank, compares with the leader."""
    assert place.leader is not None and place.leader.gap is not None
    words = _("%(gap)s s faster than the leader, %(alias)s")
    if place.leader.gap >= 0:
        words = _("%(gap)s s slower than the leader, %(alias)s")
    return words % {"gap": gap(abs(place.leader.gap))[1:], "alias": place.leader.entry.racer.alias}


def behind(place: Place, rival: Rival) -> str:
    """The gap to an entry ahead: a time, or once duels are drawn points or ties; a dash between different rankings."""
    if not place.is_drawn:
        return "–" if rival.gap is None else gap(rival.gap)
    if rival.gap is None:
        return _("duels won equal") if place.counts_ties else _("points equal")
    if place.counts_ties:
        return ngettext("%(count)s duel", "%(count)s duels", rival.gap) % {"count": rival.gap}
    return ngettext("%(count)s point", "%(count)s points", rival.gap) % {"count": rival.gap}


def _box_rules(race: Race) -> list[str]:
    if race.boxes:
        where = ngettext(
            "%(count)s box on the track, as shown on the map, the same for every car.",
            "%(count)s boxes on the track, as shown on the map, the same for every car.",
            len(race.boxes),
        ) % {"count": len(race.boxes)}
    else:
        where = ngettext(
            "%(count)s box on the track, placed by the seed, the same in every lap for every car.",
            "%(count)s boxes on the track, placed by the seed at least %(distance)s m apart, the "
            "same in every lap for every car.",
            race.random_boxes,
        ) % {"count": race.random_boxes, "distance": f"{race.box_distance_m:g}"}
    return [where, _("A box is 40 cm wide, 30 cm long and 25 cm high, in the middle of its lane.")]


def _bot_rules(race: Race) -> list[str]:
    bots = ngettext(
        "%(count)s bot drives round the track at %(speed)s m/s.",
        "%(count)s bots drive round the track at %(speed)s m/s, spread evenly at the start.",
        race.bots,
    ) % {"count": race.bots, "speed": f"{race.bot_speed_mps:g}"}
    if race.bot_lane_changes:
        lanes = _("Bots change lanes every %(least)s to %(most)s s, drawn from the seed: the same for every car.") % {
            "least": f"{race.bot_lane_change_least_ms / 1000:g}",
            "most": f"{race.bot_lane_change_most_ms / 1000:g}",
        }
        if race.bot_lane_change_m != RaceRules.bot_lane_change_m:
            lanes += " " + _("A change takes %(metres)s m.") % {"metres": f"{race.bot_lane_change_m:g}"}
    else:
        lanes = _("Bots stay in their lanes.")
    return [bots, lanes]


def _duel_rules(race: Race) -> list[str]:
    return [
        _(
            "While the race is open, each car qualifies alone. After closing, %(cars)s cars at a "
            "time drive together, with gaps at the start, and each is timed separately."
        )
        % {"cars": race.duel_cars},
        *(
            [_("They start %(metres)s m apart.") % {"metres": f"{race.duel_gap_m:g}"}]
            if race.duel_gap_m != RaceRules.duel_gap_m
            else []
        ),
        *([_("The duels are shown in a live event.")] if race.duels_live_only else []),
    ]


def _crash_rule(race: Race) -> str:
    if not race.max_resets:
        return _("A crash is a fault like leaving the track, and ends the run.")
    values = {"seconds": f"{race.collision_penalty_ms / 1000:g}", "times": RaceRules.mercy_resets}
    if race.boxes or race.random_boxes:
        rule = _(
            "A car that hits a box waits %(seconds)s s and restarts before the box in the other "
            "lane. After reset %(times)s at the same box it restarts behind the box. It never "
            "restarts before a box it has passed."
        )
    else:
        rule = _("When two cars touch, the one behind is at fault and waits %(seconds)s s on the spot.")
    clock = _("The clock keeps running.")  # not inside the f-string, where gettext does not look
    return f"{rule % values} {clock}"
