"""A bucket for tests of what is stored in one."""

from __future__ import annotations

import boto3
import pytest

from tests.outages.bucket import BUCKET, S3Server


@pytest.fixture(scope="module")
def server():
    one = S3Server()
    yield one
    one.close()


@pytest.fixture
def s3(server, settings):
    """The site's files are in an empty bucket."""
    server.be("")
    client = boto3.client(
        "s3",
        endpoint_url=server.address,
        region_name="us-east-1",
        aws_access_key_id="a-key",
        aws_secret_access_key="a-secret",
    )
    client.create_bucket(Bucket=BUCKET)
    backend = {"BACKEND": "storages.backends.s3.S3Storage", "OPTIONS": server.options()}
    settings.STORAGES = {**settings.STORAGES, "default": backend}
    yield server
    server.be("")
    for one in client.list_objects_v2(Bucket=BUCKET).get("Contents", ()):
        client.delete_object(Bucket=BUCKET, Key=one["Key"])
