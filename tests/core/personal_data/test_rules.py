"""Every column that may name a person is in exactly one rule for account deletion, and in one for the download."""

from __future__ import annotations

from collections import Counter

import pytest
from django.apps import apps
from django.db import models

from accounts.models import Racer
from core.personal_data.columns import personal_columns
from core.personal_data.rules import PersonalData, all_rules


def all_personal_columns() -> dict[str, list[str]]:
    """The columns that need a rule by the label of their model; models without any are left out."""
    found = {model._meta.label: personal_columns(model) for model in apps.get_models(include_auto_created=True)}
    return {label: columns for label, columns in found.items() if columns}


def fates(rule: PersonalData) -> list[str]:
    """Each column that deleting an account treats by itself, once for each rule."""
    return " ".join((rule.erased, rule.anonymised, *rule.kept.values())).split()


def test_each_personal_column_has_one_rule_for_deletion():
    rules, wrong = all_rules(), []
    for label, columns in all_personal_columns().items():
        if label not in rules:
            wrong.append(f"{label}: {' '.join(columns)}")
            continue
        rule, counted = rules[label], Counter(fates(rules[label]))
        wrong += [f"{label}.{column} is in {count} rules" for column, count in counted.items() if count > 1]
        alone = () if rule.rows else set(columns) - set(counted)
        wrong += [f"{label}.{column} is in no rule" for column in sorted(alone)]
    assert not wrong, "\n".join(wrong)


def test_each_column_of_an_owner_is_exported_or_withheld_with_a_reason():
    wrong = []
    for label, rule in all_rules().items():
        if not rule.owner:
            assert not rule.section and not rule.export_rules, label
            continue
        counted = Counter(rule.export_rules)
        wrong += [f"{label}.{column} is in {count} rules" for column, count in counted.items() if count > 1]
        if rule.section:
            free = set(personal_columns(rule.model)) - set(counted) - set(rule.owner.split())
            wrong += [f"{label}.{column} is neither exported nor withheld" for column in sorted(free)]
        elif list(counted) != ["*"]:
            wrong.append(f"{label} has no section and no reason for it")
    assert not wrong, "\n".join(wrong)


def test_rules_name_columns_that_exist():
    wrong = [
        f"{label}.{column}"
        for label, rule in all_rules().items()
        for column in {*fates(rule), *rule.export_rules, *rule.mentions.split()} - {"*"}
        if column not in {field.name for field in rule.model._meta.get_fields()}
    ]
    assert not wrong


def test_sections_of_the_download_have_names_of_their_own():
    sections = Counter(rule.section for rule in all_rules().values() if rule.section)
    assert max(sections.values()) == 1 and all(name.isidentifier() for name in sections)


def test_reasons_are_sentences():
    reasons = [reason for rule in all_rules().values() for reason in (*rule.kept, *rule.withheld)]
    assert reasons and all(reason.endswith(".") and " " in reason for reason in reasons)


@pytest.mark.parametrize(
    "column",
    [
        models.ForeignKey(Racer, models.CASCADE, related_name="+"),
        models.EmailField(),
        models.GenericIPAddressField(),
        models.JSONField(),
        models.TextField(),
        models.FileField(),
        models.CharField(max_length=9),
    ],
    ids=lambda column: type(column).__name__,
)
def test_a_new_column_that_may_name_a_person_needs_a_rule(column):
    class OddDiary(models.Model):
        class Meta:
            app_label = "tracks"
            managed = False

    column.contribute_to_class(OddDiary, "nickname" if not isinstance(column, models.CharField) else "last_name")
    try:
        assert "OddDiary" in " ".join(all_personal_columns()) and "tracks.OddDiary" not in all_rules()
        with pytest.raises(AssertionError, match="OddDiary"):
            test_each_personal_column_has_one_rule_for_deletion()
    finally:
        del apps.all_models["tracks"]["odddiary"]
        apps.clear_cache()
