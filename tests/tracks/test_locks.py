"""One change at a time for one row."""

import pytest
from django.contrib.auth import get_user_model
from django.db import transaction
from django.utils.functional import SimpleLazyObject

from core.locks import hold

pytestmark = pytest.mark.django_db


def test_the_racer_of_a_request_is_held_although_it_is_a_lazy_stand_in():
    racer = get_user_model().objects.create_user("lena", "lena@example.org")
    with transaction.atomic():
        hold(SimpleLazyObject(lambda: racer))


def test_a_row_that_is_gone_is_not_held():
    racer = get_user_model().objects.create_user("lena", "lena@example.org")
    get_user_model().objects.all().delete()
    with pytest.raises(get_user_model().DoesNotExist), transaction.atomic():
        hold(racer)
