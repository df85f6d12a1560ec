"""Serializers of seasons, rounds and standings."""

from rest_framework import serializers

from core.api.documents import serializer_of
from core.api.fields import ComputedField
from league.models import Stage
from league.seasons.services.seasons import edition_of
from league.standings.exports import CellDocument
from league.standings.selectors.months import months_of
from league.standings.selectors.outcomes import rules_of
from league.standings.selectors.tables import divisions_with_points
from paddock.rules.race import STAGE
from races.boards.ranking import RULES
from races.models import Division, RaceState
from races.rules.serializers import with_rules

DIVISIONS = Division.values


class SeasonSerializer(serializers.Serializer):
    """A season."""

    slug = serializers.CharField()
    name = serializers.CharField()
    starts_on = serializers.DateField()
    ends_on = serializers.DateField(help_text="The last day.")
    races = serializers.IntegerField(source="race_count")
    official = serializers.IntegerField(source="official_count", help_text="How many of them are official.")
    topic = ComputedField(
        serializers.CharField(), lambda season: f"season:{season.pk}", help_text="Its topic on the live stream."
    )


class StageRulesSerializer(with_rules(serializers.Serializer, STAGE)):  # type: ignore[misc]
    """How the races of a stage are ranked and limited by default."""

    stage = serializers.ChoiceField(Stage.choices)
    ranking_rule = ComputedField(
        serializers.CharField(),
        lambda rules: RULES[rules.ranking_method].rule(rules),
        help_text="In plain sentences, in the reader's language.",
    )


class SeasonDetailSerializer(SeasonSerializer):
    """A season with its settings and what they mean."""

    promotion_percent = serializers.FloatField(help_text="Of the classified racers of a month's open race.")
    finale_size = serializers.IntegerField()
    championship_places = serializers.IntegerField(help_text="From each finale.")
    points = serializers.ListField(child=serializers.IntegerField(), help_text="By place, the winner's first.")
    drop_worst = serializers.IntegerField()
    steward_hours = serializers.IntegerField()
    prizes = serializers.CharField(allow_blank=True)
    continues = serializers.BooleanField(help_text="Whether the season that follows is drafted 60 days ahead.")
    follows = serializers.CharField(
        source="follows.slug", default=None, allow_null=True, help_text="The season that this one continues."
    )
    rules = ComputedField(
        serializers.ListField(child=serializers.CharField()),
        rules_of,
        help_text="In plain sentences, in the reader's language.",
    )
    stage_rules = StageRulesSerializer(source="stage_rules.all", many=True)
    divisions = ComputedField(
        serializers.ListField(child=serializers.ChoiceField(DIVISIONS)),
        lambda season: divisions_with_points(months_of(season)),
        help_text="Those that standings are kept for.",
    )
    edition = ComputedField(
        serializers.CharField(), edition_of, help_text="Another after every change; see the change of a season."
    )


class RoundSerializer(serializers.Serializer):
    """One race of a season. The races of a month share ``number`` and ``month`` and differ in ``stage``."""

    number = serializers.IntegerField(source="round.number")
    month = serializers.CharField(source="round.name", allow_blank=True)
    stage = serializers.ChoiceField(Stage.choices, source="round.stage")
    race = serializers.CharField(source="race.slug")
    name = serializers.CharField(source="race.name")
    track = serializers.CharField(source="race.track.slug")
    opens_at = serializers.DateTimeField(source="race.opens_at")
    closes_at = serializers.DateTimeField(source="race.closes_at")
    state = serializers.ChoiceField(RaceState.choices)
    official_since = serializers.DateTimeField(source="round.closed_at", allow_null=True)
    final_since = ComputedField(
        serializers.DateTimeField(allow_null=True),
        lambda one: one.round.settled_at,
        help_text="Or from when on; null before the round is official.",
    )
    leader = serializers.CharField(
        source="leader.alias", default=None, allow_null=True, help_text="The leader or winner; null: none yet."
    )


class StandingSerializer(serializers.Serializer):
    """One line of standings."""

    place = serializers.IntegerField()
    name = serializers.CharField(help_text="Of a racer, region or team, or the two-letter code of a country.")
    country = serializers.CharField(allow_blank=True, help_text="Of a racer.")
    points = serializers.IntegerField()
    rounds = serializer_of(CellDocument)(many=True, help_text="Those with points, in their order.")


class RacerRoundSerializer(serializers.Serializer):
    """A round in a racer's season, and what came of it for them."""

    race = serializers.CharField(source="round.race.slug")
    number = serializers.IntegerField(source="round.number")
    stage = serializers.ChoiceField(Stage.choices, source="round.stage")
    closes_at = serializers.DateTimeField(source="round.race.closes_at")
    official = ComputedField(serializers.BooleanField(), lambda row: row.round.closed_at is not None)
    rank = serializers.IntegerField(allow_null=True, help_text="null: not classified.")
    points = serializers.IntegerField(help_text="0 while the round is not official.")
    score_ms = serializers.IntegerField(source="entry.score_ms", allow_null=True)
    best_lap_ms = serializers.IntegerField(source="entry.best_lap_ms", allow_null=True)
    promoted = serializers.BooleanField()
    in_finale = serializers.BooleanField(help_text="Came into the finale by it.")
    qualified = serializers.BooleanField(help_text="For the championship.")


class PlaceSerializer(serializers.Serializer):
    """Where somebody stands."""

    place = serializers.IntegerField()
    points = serializers.IntegerField()


class RacerSeasonSerializer(serializers.Serializer):
    """A racer's season."""

    season = serializers.CharField()
    racer = serializers.CharField()
    division = serializers.ChoiceField(Division.choices)
    promoted_in = serializers.CharField(allow_null=True, help_text="The open race that promoted them.")
    qualified_in = serializers.CharField(allow_null=True, help_text="The finale that qualified them.")
    standings = serializers.DictField(child=PlaceSerializer(), help_text="In each division that they have points in.")
    rounds = RacerRoundSerializer(many=True)
