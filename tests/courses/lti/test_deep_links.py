"""The choice of an assignment on the platform, and what is shown in a frame."""

from __future__ import annotations

from datetime import timedelta
from html import unescape

import jwt
import pytest
from django.test import Client

from courses.models import LtiLine
from tests.courses.assignments import an_assignment
from tests.courses.lti.launching import SITE, begin, launched, refused
from tests.courses.lti.platform import CLAIM, DEEP, Platform

pytestmark = pytest.mark.django_db


def ask(platform: Platform, sub: str = "t-1", **settings):
    """The page of the choice."""
    client = Client()
    asked = begin(client, platform, sub)
    token = platform.signed(platform.deep(sub, asked["nonce"], **settings))
    return client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})


def tokens(answer) -> list[str]:
    parts = answer.content.decode().split('name="JWT" value="')[1:]
    return [unescape(part.partition('"')[0]) for part in parts]


def test_a_chosen_assignment_comes_back_to_its_page(course, platform, now):
    """The signed answer makes the link and its column; the link's launch opens the assignment."""
    chosen = an_assignment(course.group, now)
    (token,) = tokens(ask(platform))
    found = platform.read(token, platform.base)
    assert found[f"{DEEP}data"] == "of the form"
    assert found[f"{CLAIM}deployment_id"] == platform.deployment
    (item,) = found[f"{DEEP}content_items"]
    assert (item["type"], item["url"], item["title"]) == ("ltiResourceLink", f"{SITE}/lti/launch/", "First")
    assert item["lineItem"]["scoreMaximum"] == 100
    platform.link, platform.lines["9"] = item["custom"], {"id": f"{platform.base}/lines/9"}
    _client, answer = launched(platform, "s-1")
    assert answer["Location"] == chosen.get_absolute_url()
    assert LtiLine.objects.get().url == f"{platform.base}/lines/9"


def test_all_assignments_of_the_class_and_no_others_are_offered(course, platform, now, alice):
    for number in range(3):
        an_assignment(course.group, now, title=f"Number {number}", due_at=now + timedelta(days=number + 1))
    from accounts.class_accounts.services import make_class

    an_assignment(make_class(teacher=alice, name="Other", plan=(), now=now).group, now, title="Elsewhere")
    answer = ask(platform)
    assert len(tokens(answer)) == 3
    assert "Elsewhere" not in answer.content.decode()


def test_a_link_to_an_assignment_of_another_class_opens_the_class(course, platform, now, alice):
    from accounts.class_accounts.services import make_class

    other = an_assignment(make_class(teacher=alice, name="Other", plan=(), now=now).group, now)
    platform.link = {"assignment": other.public_id}
    assert launched(platform, "t-1")[1]["Location"] == course.group.classroom.get_absolute_url()
    assert not LtiLine.objects.exists()


def test_a_student_chooses_nothing(course, platform):
    assert refused(ask(platform, "s-1")) == "lti_role"


def test_an_instructor_of_another_course_sees_no_assignment_of_this_one(course, platform, now):
    an_assignment(course.group, now)
    platform.people["t-2"] = ("Barbara Liskov", "Instructor")
    assert refused(ask(platform, "t-2")) == "lti_no_class"  # they have not opened this course


def test_a_token_for_the_choice_is_used_once(course, platform):
    client = Client()
    asked = begin(client, platform, "t-1")
    sent = {"id_token": platform.signed(platform.deep("t-1", asked["nonce"])), "state": asked["state"]}
    assert client.post("/lti/launch/", sent).status_code == 200
    assert refused(client.post("/lti/launch/", sent)) == "lti_expired"


@pytest.mark.parametrize(
    "address",
    [
        None,
        7,
        "javascript:alert(1)",
        "//example.org",
        "https://a.example.org;script-src *",
        "https://u@example.org/",
        "/x",
    ],
)
def test_the_choice_goes_to_addresses_alone(course, platform, address):
    assert refused(ask(platform, deep_link_return_url=address)) == "lti_message"


class TestFrames:
    def test_the_choice_is_shown_in_frames_of_the_platform_alone(self, course, platform):
        answer = ask(platform)
        policy = answer["Content-Security-Policy"]
        assert f"frame-ancestors {platform.base};" in f"{policy};"
        assert f"form-action {platform.base};" in f"{policy};"
        assert "X-Frame-Options" not in answer.headers

    def test_a_log_in_in_a_frame_opens_a_window(self, registered, platform):
        asked = {"iss": platform.base, "login_hint": "s-1", "target_link_uri": f"{SITE}/lti/launch/"}
        answer = Client().get("/lti/log-in/", asked, headers={"Sec-Fetch-Dest": "iframe"})
        assert answer.status_code == 200
        assert 'target="_blank"' in answer.content.decode()
        assert "X-Frame-Options" not in answer.headers
        assert not answer.cookies

    def test_the_way_to_the_choice_stays_in_its_frame(self, registered, platform):
        asked = {"iss": platform.base, "login_hint": "t-1", "target_link_uri": f"{SITE}/lti/choose/"}
        assert Client().get("/lti/log-in/", asked, headers={"Sec-Fetch-Dest": "iframe"}).status_code == 302

    def test_a_refusal_is_shown_in_a_frame_without_any_button(self, registered):
        answer = Client().post("/lti/launch/")
        assert "X-Frame-Options" not in answer.headers
        assert b"<button" not in answer.content
        assert b"<form" not in answer.content

    def test_no_other_page_is_shown_in_a_frame(self, registered, platform):
        _client, answer = launched(platform, "t-1")
        assert answer["X-Frame-Options"] == "DENY"
        assert "frame-ancestors 'none'" in answer["Content-Security-Policy"]

    def test_the_cookie_of_a_log_in_comes_back_from_another_site(self, registered, platform, settings):
        settings.BEHIND_HTTPS = True
        client = Client()
        begin(client, platform, "s-1")
        (cookie,) = client.cookies.values()
        assert (cookie["samesite"], cookie["secure"], cookie["httponly"]) == ("None", True, True)


def test_the_tests_platform_refuses_what_the_site_did_not_sign(course, platform):
    token = jwt.encode({"iss": platform.client_id, "aud": platform.base, "exp": 1, "iat": 1}, "x" * 32, "HS256")
    with pytest.raises(jwt.InvalidTokenError):
        platform.read(token, platform.base)
