"""A new kind of notice is one entry: the settings, the API, mails, webhooks and the docs have it at once."""

from __future__ import annotations

import pytest
from allauth.account.models import EmailAddress
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.plumbing import _load_enum_name_overrides
from rest_framework.test import APIClient

from league.models import Mail, Notice
from league.notices import kinds
from league.notices.selectors import notices_of
from league.notices.services import choice_of, send_mails, stop_mails
from league.notices.writer import NewNotice, notify
from tests.docs import notice_table
from tests.docs.pages import code_blocks, section, text
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db
NAME = "weather"
# The kind that the page of common changes shows, and what writes it
BLOCKS = code_blocks(section(text("changes.md"), "## A kind of notice"), "python")


@pytest.fixture(autouse=True)
def shown():
    _load_enum_name_overrides.cache_clear()
    shown = {}
    exec(compile("\n".join(BLOCKS), "changes.md", "exec"), shown)
    yield shown
    del kinds.KINDS[NAME]
    _load_enum_name_overrides.cache_clear()


def test_a_name_that_is_taken_or_too_long_is_refused():
    for name in (NAME, "opens", "", "a-very-long-name"):
        with pytest.raises(ValueError, match="another kind"):
            kinds.register(name, "", "")


def test_the_settings_page_has_its_two_boxes(client):
    alice = a_racer("alice")
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    page = client.get("/settings/notices/").content.decode()
    assert "it rains" in page and f'name="site_{NAME}"' in page and f'name="mail_{NAME}"' in page
    client.post("/settings/notices/", {"language": "en", f"site_{NAME}": "on"})
    assert NAME in choice_of(alice).mail_off and NAME not in choice_of(alice).site_off


def test_the_api_names_it_in_the_schema_and_takes_it():
    schemas = SchemaGenerator().get_schema(request=None, public=True)["components"]["schemas"]
    assert NAME in schemas["NoticeKind"]["enum"]
    client = APIClient()
    client.force_authenticate(a_racer("alice"))
    answer = client.patch("/api/v1/notices/settings/", {"mail_off": [NAME]}, format="json")
    assert (answer.status_code, answer.data["mail_off"]) == (200, [NAME])


def test_its_notice_is_shown_and_mailed_in_its_sentence(now, mailoutbox, wakes):
    alice = a_racer("alice")
    EmailAddress.objects.create(user=alice, email=alice.email, verified=True, primary=True)
    assert notify(NewNotice(kinds.KINDS[NAME], "x", [alice.pk], "/", {"race": "Oval"}), now) == 1
    assert [one.kind for one in notices_of(alice)] == [NAME]
    assert send_mails(now=now) == 1
    (mail,) = mailoutbox
    assert "It rains at" in mail.subject and "Oval" in mail.body
    client = APIClient()
    client.force_authenticate(alice)
    (shown,) = client.get("/api/v1/notices/").data["results"]
    assert shown["kind"] == NAME and "Oval" in shown["text"]
    stop_mails(racer=alice, kind=kinds.KINDS[NAME])
    notify(NewNotice(kinds.KINDS[NAME], "y", [alice.pk], "/", {"race": "Oval"}), now)
    assert Notice.objects.count() == 2 and Mail.objects.count() == 1


def test_a_kind_that_is_not_mailed_comes_by_mail_only_when_chosen():
    kinds.KINDS[NAME].mailed = False
    assert NAME in choice_of(a_racer("alice")).mail_off


def test_the_table_of_the_docs_has_it():
    assert f"| `{NAME}` | it rains | yes |  |" in notice_table.table()


def test_the_function_of_the_page_writes_it_once(now, shown):
    alice, race = a_racer("alice"), a_race(now)
    assert [shown["write_weather"](race, [alice], now) for _ in range(2)] == [1, 0]
    notice = Notice.objects.get()
    assert (notice.racer, notice.kind, notice.path) == (alice, NAME, race.get_absolute_url())
