"""Backup and restore of a site whose files are in a bucket."""

from __future__ import annotations

import json

import pytest
from django.core.files.storage import default_storage
from django.utils import timezone

from config.operations.backup.files import stored
from config.operations.backup.making import back_up
from paddock.errors import PlatformFault
from tests.config.backed_up import answers
from tests.config.test_backup import addresses, command, empty_place
from tests.factories import a_race, a_racer, drive, laps
from tests.outages.bucket import BUCKET

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.slow]


@pytest.fixture
def race(s3, wakes):
    """A race with a car that has driven; its files are in the bucket."""
    now = timezone.now()
    race = a_race(now, slug="the-race")
    drive(race, a_racer("racer-0-of-backup"), laps(10_000, 9_000, 9_500), now)
    return race


@pytest.mark.slow
def test_a_site_restored_where_no_bucket_was_works_as_before(s3, race, tmp_path):
    asked, file = addresses(), tmp_path / "site.backup"
    before = answers("racer-0-of-backup", asked)
    assert {status for status, _ in before.values()} == {200}
    names = set(stored())
    assert names
    back_up(path=file, now=timezone.now())
    of_bucket = {
        **{"STORAGE": f"s3://{BUCKET}", "AWS_ENDPOINT_URL_S3": s3.address, "AWS_DEFAULT_REGION": "us-east-1"},
        **{"AWS_ACCESS_KEY_ID": "a-key", "AWS_SECRET_ACCESS_KEY": "a-secret"},
    }
    for name in names:
        default_storage.delete(name)
    default_storage.connection.meta.client.delete_bucket(Bucket=BUCKET)
    with empty_place(tmp_path) as environment:
        s3.be("full")
        refused = command(environment | of_bucket, "manage.py", "restore", str(file))
        assert refused.returncode == 3 and "Traceback" not in refused.stderr, refused.stderr
        assert "storage_failed" in refused.stderr and "minimum free drive threshold" in refused.stderr
        s3.be("")
        restored = command(environment | of_bucket, "manage.py", "restore", str(file))
        assert restored.returncode == 0, restored.stderr
        after = command(environment | of_bucket, "-m", "tests.config.backed_up", "racer-0-of-backup", *asked)
    assert set(stored()) == names
    assert json.loads(after.stdout) == before


@pytest.mark.parametrize("mood", ["stopped", "slow", "short"])
def test_a_backup_of_an_unreadable_bucket_leaves_no_file(mood, s3, race, tmp_path):
    s3.be(mood)
    with pytest.raises(PlatformFault) as raised:
        back_up(path=tmp_path / "site.backup", now=timezone.now())
    assert raised.value.code == "storage_failed"
    assert not list(tmp_path.glob("site.backup*"))
