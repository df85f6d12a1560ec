"""Every page and operation as each of the cast, with a valid and with an invalid body, against ``table.txt``.

A route without a row fails, and so does a row without a route. To add a row, write the answers that you expect.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from uuid import UUID

import pytest
from django.core.cache.backends.locmem import LocMemCache

from core.streams import TOPICS, can_follow
from tests.access.bodies import body_of_row
from tests.access.cast import PUBLIC, VIEWERS, Cast, make_cast
from tests.access.routes import FOLLOW, Row, routes, rows
from tests.kept import Kept
from tests.pages.forms import admin_addresses
from tests.soak import only

pytestmark = [pytest.mark.django_db, pytest.mark.slow, pytest.mark.xdist_group("access")]
SAFE = ("GET", FOLLOW)
REFUSED = {"401", "403", "404", "405", "login", "2fa", "class", "no"}
INVALID = {"nonsense": "5"}
# links of mails, a cookie of a language or a theme, and operations that take no session
NO_CSRF = {
    *("/lti/launch/", "/lti/choose/", "/lti/log-in/"),  # from platforms: the token and the cookie of the log-in count
    "/notices/stop/{stop}/",
    "/invitations/stop/{invited_stop}/",
    "/theme/",
    "/i18n/setlang/",
    "/api/v1/auth/token/",
    "/api/v1/timing/crossings/",
}
# what racers do with their own account, cars, runs, entries and teams, and what admins do of that for themselves
OF_RACERS = re.compile(
    r"accounts/|(api/v1/)?(cups/starter|following|racers/|notices|invitations?/|spoilers|settings/(notices/)?$|groups/join"
    r"|teams/(join|new|$)|laps/|timing/claims|models/(upload/|$)|races/(invited|join)/|reports/(new/|$)|runs/new"
    r"|settings/alias|me/alias|train/first|trainings/$|sweeps/$|vehicles|evaluations/$|auth/token/|.*/videos/$|.*webhooks/.*/test/"
    r"|races/[^/]*/(car|enter|entry|submit|submissions|event/highlights|live/highlights|live/react)/$)"
)
# what somebody else than the owner may do only as an admin
OF_OWNERS = re.compile(r"(api/v1/)?(evaluations|models|reports|train|trainings|sweeps|videos|teams)/")
KEPT_DRIVES = LocMemCache("drives", {})  # each request finds the other caches empty; driving takes seconds


@pytest.fixture(scope="session")
def kept_cast(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, make_cast)


@pytest.fixture
def cast(kept_cast: Kept, db: None, settings, monkeypatch, trainings_taken_on, wakes, video_wakes) -> Cast:
    settings.STAFF_SECOND_FACTOR = True
    monkeypatch.setattr("training.rewards.audit.services.cache", KEPT_DRIVES)
    return kept_cast.copy()


@pytest.fixture
def table(cast: Cast) -> list[Row]:
    return rows(cast)


@pytest.mark.parametrize("viewer", only(("guest", "stranger", "pupil", "bare"), VIEWERS))
def test_every_request_gets_the_answer_of_the_table(viewer: str, cast: Cast, table: list[Row]) -> None:
    """A request that is refused is refused for any body, and writes nothing."""
    wrong = []
    for row in table:
        expected, address = row.answers[viewer], cast.fill(row.address, viewer)
        if row.method == FOLLOW:
            answers = ["yes" if can_follow(cast.racers[viewer], address) else "no"]
        elif row.method == "GET":
            answers = [str(cast.ask(viewer, "GET", address))]
        else:
            body, form = body_of_row(cast, row, viewer)
            answers = [str(cast.ask(viewer, row.method, address, sent, form=form)) for sent in (body, INVALID)]
        if expected not in REFUSED and not expected.endswith("+"):
            answers = [answer.rstrip("+") for answer in answers]
        if (
            answers[0] != expected.rstrip("*")
            or (expected in REFUSED and set(answers) != {expected})
            or "500" in answers
        ):
            wrong.append(f"{row.method} {row.address}: {answers}, not {expected}")
    assert not wrong, "\n".join(wrong)


def test_every_route_and_topic_has_a_row(cast: Cast, table: list[Row]) -> None:
    tested = {(row.method, row.route) for row in table}
    there = {
        (method, route)
        for route, view in routes().items()
        for method in ("GET", "POST", "PUT", "PATCH", "DELETE")
        if (hasattr(view, method.lower()) if view else method == "GET")
    }
    there |= {(FOLLOW, f"{FOLLOW} {topic}") for topic in TOPICS}
    assert there - tested == set()
    unknown = {(FOLLOW, f"{FOLLOW} nonsense")}
    assert {one for one in tested - there - unknown if one[0] != "POST" or routes()[one[1]]} == set(), "stale rows"


@pytest.mark.parametrize("viewer", only(["staff"], ["guest", "staff"]))
def test_pages_without_a_row_for_a_method_do_not_take_it(viewer: str, cast: Cast, table: list[Row]) -> None:
    posted = {row.route for row in table if row.method == "POST"}
    wrong = []
    for row in table:
        if row.method != "GET" or row.view or row.route.startswith(("accounts/", "i18n/")):  # of libraries
            continue
        for method in ("PUT", "PATCH", "DELETE", *(() if row.route in posted else ("POST",))):
            answer = cast.ask(viewer, method, cast.fill(row.address))
            if answer.written or answer.status not in ("405", "login", "404"):
                wrong.append(f"{method} {row.address}: {answer}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("viewer", only(("guest", "stranger"), ("guest", "stranger", "pupil")))
def test_private_objects_are_answered_like_objects_that_do_not_exist(viewer: str, cast: Cast, table: list[Row]) -> None:
    wrong = []
    seen = PUBLIC | names_seen_by(viewer, table)
    for row in table:
        # 403 is for who reads the object and may not do this with it
        names = set(re.findall(r"{(\w+)}", row.address)) - (seen if row.answers[viewer] == "403" else PUBLIC)
        if row.method == FOLLOW or not names or row.answers[viewer] not in REFUSED - {"login", "2fa", "class"}:
            continue
        missing = row.address.format(**cast.words | {"mine": ""} | {name: _unlike(cast.words[name]) for name in names})
        answer = cast.ask(viewer, row.method, missing, INVALID if row.method != "GET" else None)
        if str(answer) != row.answers[viewer]:
            wrong.append(f"{row.method} {row.address}: {row.answers[viewer]}, but {answer} for what does not exist")
    assert not wrong, "\n".join(wrong)


def names_seen_by(viewer: str, table: list[Row]) -> set[str]:
    """Of objects that the viewer reads by the API."""
    own = ((row, re.fullmatch(r"/api/v1/\w+/{(\w+)}/", row.address)) for row in table if row.method == "GET")
    return {found[1] for row, found in own if found and row.answers[viewer] == "200"}


@pytest.mark.parametrize("viewer", only(("organiser", "staff"), ("organiser", "teacher", "staff")))
def test_what_an_organiser_or_an_admin_changes_is_in_the_audit_log(viewer: str, cast: Cast, table: list[Row]) -> None:
    """Except for what every racer may do with their own things."""
    unlogged = []
    for row in table:
        own = OF_RACERS.match(row.route) or (viewer != "staff" and OF_OWNERS.match(row.route))
        if row.method in SAFE or row.answers[viewer] in REFUSED or own:
            continue
        body, form = body_of_row(cast, row, viewer)
        answer = cast.ask(viewer, row.method, cast.fill(row.address, viewer), body, form=form)
        if answer.written and int(answer.response.status_code) < 400 and "core_auditentry" not in answer.written:
            unlogged.append(f"{row.method} {row.route}: {sorted(answer.written)}")
    assert not unlogged, "\n".join(unlogged)


def _unlike(value: str) -> str:
    """The same kind of name, of nothing."""
    if value.isdigit():
        return "999999"
    return str(UUID(int=9)) if re.fullmatch(r"[0-9a-f-]{36}", value) else "zzzzzzzzzzzz"


def test_no_write_with_a_session_works_from_another_site(cast: Cast, table: list[Row]) -> None:
    wrong = []
    for row in table:
        if row.method in SAFE or row.address in NO_CSRF or row.answers["organiser"] in REFUSED:
            continue
        body, form = body_of_row(cast, row, "organiser")
        answer = cast.ask("organiser", row.method, cast.fill(row.address), body, form=form, forged=True)
        if str(answer) != "403":
            wrong.append(f"{row.method} {row.address}: {answer}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("viewer", ["guest", "stranger"])
def test_htmx_gets_no_more_than_a_browser(viewer: str, cast: Cast, table: list[Row]) -> None:
    wrong = []
    for row in table:
        if row.method != "GET" or row.view or row.answers[viewer] not in REFUSED:
            continue
        answer = cast.ask(viewer, "GET", cast.fill(row.address), headers={"hx-request": "true"})
        if str(answer) != row.answers[viewer]:
            wrong.append(f"{row.address}: {answer}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("viewer", only(("guest", "stranger", "bare"), ("guest", "stranger", "organiser", "bare")))
def test_the_admin_site_is_closed_to_everybody_but_staff_with_a_second_factor(viewer: str, cast: Cast) -> None:
    wrong = []
    for address in admin_addresses():
        for method in ("GET", "POST") if address != "/admin/login/" else ():
            answer = cast.ask(viewer, method, address, INVALID)
            if str(answer) != ("2fa" if viewer == "bare" else "login"):
                wrong.append(f"{method} {address}: {answer}")
    assert not wrong, "\n".join(wrong)
