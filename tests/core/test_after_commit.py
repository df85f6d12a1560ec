"""Work after a commit fails alone."""

import pytest
from django.db import transaction

from core.database.after_commit import after_commit


@pytest.mark.django_db(transaction=True)
def test_a_failure_after_the_commit_is_logged_and_stops_nothing(caplog):
    done = []

    def broken(name: str) -> None:
        raise RuntimeError(name)

    with transaction.atomic():
        after_commit(broken, "storage is out")
        after_commit(done.append, 1)
        assert not done
    assert done == [1]
    assert "storage is out" in caplog.text
