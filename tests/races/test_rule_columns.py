"""What the database holds of the rules is what the list says: bounds, defaults, words."""

from __future__ import annotations

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction

from paddock.rules.race import EASIER_FIRST, HEAD_TO_HEAD, OBJECT_AVOIDANCE, RANKING, RULES, STAGE, all_laps
from races.models import Race
from races.models.rules import choices_of, column
from races.pages.services import edit_race
from tests.factories import a_race

COLUMNS = [name for name, rule in RULES.items() if rule.column]
INSIDE = [name for name, rule in RULES.items() if not rule.column]
# The database leaves these to the application: no order of a board and no result hangs on them.
NOT_CONSTRAINED = {"seed", "max_resets", "max_submissions"}
WITH_ITS_TYPE = {
    "random_boxes": {"race_type": OBJECT_AVOIDANCE},
    "bots": {"race_type": HEAD_TO_HEAD, "opponents": "bots"},
    "duel_cars": {"race_type": HEAD_TO_HEAD, "opponents": "models", "duel_format": "round_robin"},
}
BOUNDED = [
    (name, value)
    for name in COLUMNS
    if name not in NOT_CONSTRAINED
    for value in (RULES[name].least, RULES[name].most)
    if value is not None
]


def stored(race: Race, **values: object) -> None:
    Race.objects.filter(pk=race.pk).update(**values)


@pytest.mark.django_db
class TestDatabase:
    @pytest.mark.parametrize(("name", "value"), BOUNDED)
    def test_the_database_enforces_both_bounds(self, name, value, now):
        race, rule = a_race(now), RULES[name]
        others = {"laps": {"minimum_laps": 1}, "minimum_laps": {"laps": 20}}.get(name, WITH_ITS_TYPE.get(name, {}))
        with transaction.atomic():
            stored(race, **{**others, name: value})
        beyond = value - 1 if value == rule.least else value + 1
        with pytest.raises(IntegrityError), transaction.atomic():
            stored(race, **{**others, name: beyond})

    @pytest.mark.parametrize("name", INSIDE)
    def test_a_rule_without_a_column_is_stored(self, name, now):
        race, rule = a_race(now), RULES[name]
        assert Race.objects.get(pk=race.pk).rules[name] == rule.default
        other = not rule.default if rule.type is bool else rule.most if name.endswith("_most_ms") else rule.least
        edit_race(race=race, now=now, **{name: other})
        again = Race.objects.get(pk=race.pk)
        assert (getattr(again, name), again.rules[name]) == (other, other)

    @pytest.mark.parametrize("name", INSIDE)
    def test_a_row_older_than_a_rule_has_its_default(self, name, now):
        race = a_race(now)
        stored(race, rules={})
        assert getattr(Race.objects.get(pk=race.pk), name) == RULES[name].default


@pytest.mark.parametrize("name", INSIDE)
def test_a_value_of_the_wrong_type_is_refused_by_name(name):
    with pytest.raises(ValidationError) as refused:
        Race(**{name: "nonsense"}).clean_fields(exclude=[one.name for one in Race._meta.fields])
    assert set(refused.value.error_dict) == {name}


@pytest.mark.parametrize("name", [name for name in RULES if RULES[name].choices])
def test_every_choice_has_a_label(name):
    assert [value for value, _word in choices_of(RULES[name])] == list(RULES[name].choices)


@pytest.mark.parametrize("name", [name for name in COLUMNS if name not in ("boxes", "sensors")])
def test_a_column_has_the_default_of_its_rule(name):
    assert Race._meta.get_field(name).get_default() == column(RULES[name]).get_default() == RULES[name].default


def test_orderings_and_selections_name_existing_rules():
    assert {name.lstrip("-") for name in (*EASIER_FIRST, *RANKING, *STAGE)} <= set(RULES)
    assert all_laps(4) == {"ranking_method": "total", "laps": 4, "minimum_laps": 4}
