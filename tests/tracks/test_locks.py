"""One change at a time for one row."""

import pytest
from django.contrib.auth import get_user_model
from django.db import transaction
from django.utils.functional import SimpleLazyObject

from core.database.locks import hold

pytestmark = pytest.mark.django_db


def test_a_lazy_request_user_can_be_locked():
    racer = get_user_model().objects.create_user("lena", "lena@example.org")
    with transaction.atomic():
        hold(SimpleLazyObject(lambda: racer))


def test_a_deleted_row_cannot_be_locked():
    racer = get_user_model().objects.create_user("lena", "lena@example.org")
    get_user_model().objects.all().delete()
    with pytest.raises(get_user_model().DoesNotExist), transaction.atomic():
        hold(racer)
