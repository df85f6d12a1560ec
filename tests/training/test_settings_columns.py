"""The database holds a training's settings within the bounds of the list."""

from __future__ import annotations

import pytest
from django.db import IntegrityError, transaction
from django.utils import timezone

from paddock.rules.training import SETTINGS
from tests.factories import a_racer, a_track
from training.jobs.settings_checks import REFUSALS
from training.models import TrainingJob

from .jobs import a_training

NOT_CONSTRAINED = {"seed"}  # any that a column holds
NUMBERS = [name for name, rule in SETTINGS.items() if rule.least is not None and name not in NOT_CONSTRAINED]


@pytest.mark.django_db
@pytest.mark.parametrize("name", NUMBERS)
def test_a_row_takes_a_bound_and_nothing_beyond_it(name):
    job, rule = a_training(a_racer(), a_track(), timezone.now()), SETTINGS[name]
    row = TrainingJob.objects.filter(pk=job.pk)
    for bound in (rule.least, rule.most):
        row.update(**{name: bound})
    for beyond in (rule.least - 1, *([] if rule.most == 2**31 - 1 else [rule.most + 1])):
        with pytest.raises(IntegrityError), transaction.atomic():
            row.update(**{name: beyond})


@pytest.mark.parametrize("name", SETTINGS)
def test_a_columns_default_is_that_of_the_list(name):
    default = TrainingJob._meta.get_field(name).get_default()
    assert default == (0 if name == "seed" else SETTINGS[name].default)


def test_every_setting_has_its_reason():
    assert set(REFUSALS) == set(SETTINGS)
