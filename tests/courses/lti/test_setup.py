"""Setting up: the addresses for platforms, their registration, the key, and a site without LTI."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from django.test import Client

from courses.lti import keys
from courses.models import LtiPlatform
from tests.clients import logged_in
from tests.factories import a_racer
from tests.shared import CHECKOUT

pytestmark = pytest.mark.django_db
FORM = {
    "name": "Example University",
    "issuer": "https://lms.example.org",
    "client_id": "abc",
    "deployment_lines": "1\n\n 2 \n1",
    "authorize_url": "https://lms.example.org/auth",
    "token_url": "https://lms.example.org/token",
    "jwks_url": "https://lms.example.org/jwks",
    "audience": "",
    "is_active": "on",
}


@pytest.fixture
def admin(db) -> Client:
    return logged_in(a_racer(is_staff=True, is_superuser=True))


def test_an_admin_registers_a_platform(admin):
    assert admin.post("/admin/courses/ltiplatform/add/", FORM).status_code == 302
    made = LtiPlatform.objects.get()
    assert (made.deployments, made.is_active) == (["1", "2"], True)
    page = admin.get(f"/admin/courses/ltiplatform/{made.pk}/change/").content.decode()
    assert "1\n2</textarea>" in page


@pytest.mark.parametrize("address", ["http://10.0.0.1/token", "ftp://lms.example.org/", "localhost", "http://[::1]/"])
def test_a_private_address_is_refused(admin, settings, address):
    settings.LTI_PRIVATE = False
    answer = admin.post("/admin/courses/ltiplatform/add/", FORM | {"token_url": address})
    assert answer.status_code == 200
    assert not LtiPlatform.objects.exists()


def test_the_page_has_what_platforms_ask_for(admin):
    page = admin.get("/lti/").content.decode()
    for path in ("launch/", "log-in/", "keys.json", "choose/", "tool.json"):
        assert f"http://testserver/lti/{path}" in page


def test_the_file_for_canvas_names_the_same_addresses():
    found = Client().get("/lti/tool.json").json()
    assert found["target_link_uri"] == found["redirect_uris"][0] == "http://testserver/lti/launch/"
    assert found["public_jwk_url"] == "http://testserver/lti/keys.json"
    placements = found["extensions"][0]["settings"]["placements"]
    assert {one["message_type"] for one in placements} == {"LtiDeepLinkingRequest", "LtiResourceLinkRequest"}


def test_the_key_is_kept_for_its_owner_alone(settings, tmp_path):
    settings.LTI_KEY_FILE = tmp_path / "folder" / "key.pem"
    first = keys.private_key()
    assert keys.private_key() == first
    assert settings.LTI_KEY_FILE.stat().st_mode & 0o777 == 0o600
    settings.LTI_KEY_FILE.unlink()
    assert keys.private_key() != first


def test_a_site_without_lti_loads_nothing_of_it(tmp_path):
    program = (
        "import sys, django; django.setup()\n"
        "from django.urls import get_resolver, resolve, Resolver404\n"
        "from config.celery import app; app.loader.import_default_modules()\n"
        "import courses.tasks\n"
        "assert get_resolver().url_patterns\n"
        "try: resolve('/lti/launch/')\n"
        "except Resolver404: print('no page')\n"
        "print([name for name in sys.modules if name.startswith(('courses.lti', 'pylti1p3', 'jwcrypto'))])\n"
        "from django.conf import settings\n"
        "print('lti scores' in settings.CELERY_BEAT_SCHEDULE)\n"
    )
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PADDOCK_")}
    told = kept | {"PADDOCK_DATA": str(tmp_path / "data"), "DJANGO_SETTINGS_MODULE": "config.settings"}
    run = subprocess.run([sys.executable, "-c", program], cwd=CHECKOUT, env=told, capture_output=True, text=True)
    assert run.stdout.split("\n") == ["no page", "[]", "False", ""], run.stderr
