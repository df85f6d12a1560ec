"""Notices: who is told what, once, as a function of the moment."""

from __future__ import annotations

from datetime import timedelta
from urllib.parse import urlsplit

import pytest
from allauth.account.models import EmailAddress
from django.core import mail, signing
from django.db import IntegrityError, transaction
from django.test import Client

from accounts.models import Racer
from core.jobs.mails import LEASE
from core.times import written
from league.models import Mail, Notice, Stage
from league.notices import kinds as notice_kinds
from league.notices.sentences import sentence
from league.notices.services import MAILS, choice_of, choose_notices, mark_read, send_mails, stopping_token
from league.stewarding.official_results import close_due_rounds
from league.stewarding.services import disqualify, put_back
from paddock.errors import UserFault
from races.pages.services import cancel_race
from tests.factories import a_race, a_racer, drive, laps
from tests.happened import tell_what_happened
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers

pytestmark = pytest.mark.django_db


def told(racer: Racer, kind: str = "") -> list[str]:
    """The kinds of a racer's notices, the earliest first."""
    own = Notice.objects.filter(racer=racer, hidden=False).order_by("pk")
    return list((own.filter(kind=kind) if kind else own).values_list("kind", flat=True))


def confirmed(racer: Racer) -> Racer:
    EmailAddress.objects.create(user=racer, email=racer.email, verified=True, primary=True)
    return racer


class TestCommunityRace:
    def test_its_racers_are_told_of_opening_closing_and_result(self, now):
        race = a_race(now, opens_at=now, closes_at=now + timedelta(days=5))
        racer, stranger = racers(2)
        board(race, [racer])
        assert tell_what_happened(now=now - HOUR) == 0
        tell_what_happened(now=now)
        tell_what_happened(now=race.closes_at - HOUR)
        tell_what_happened(now=race.closes_at)
        assert told(racer) == ["opens", "closes", "official"]
        assert told(stranger) == []

    def test_each_racer_is_told_once(self, now):
        race = a_race(now, opens_at=now, closes_at=now + timedelta(days=5))
        board(race, racers(3))
        assert tell_what_happened(now=now) == 3
        assert tell_what_happened(now=now) == tell_what_happened(now=now + HOUR) == 0
        first = Notice.objects.first()
        with pytest.raises(IntegrityError), transaction.atomic():
            Notice.objects.create(racer=first.racer, kind=first.kind, about=first.about, at=now)

    def test_a_late_scheduler_tells_only_recent_things(self, now):
        race = a_race(now, opens_at=now, closes_at=now + timedelta(days=20))
        (racer,) = racers(1)
        board(race, [racer])
        tell_what_happened(now=now + timedelta(days=4))
        assert told(racer) == []
        other = a_race(now, opens_at=now, closes_at=now + timedelta(days=20))
        board(other, [racer])
        tell_what_happened(now=now + timedelta(days=2))
        assert told(racer) == ["opens", "opens"]

    def test_a_postponed_race_is_announced_again(self, now):
        race = a_race(now, opens_at=now, closes_at=now + timedelta(days=9))
        (racer,) = racers(1)
        board(race, [racer])
        tell_what_happened(now=now)
        type(race).objects.filter(pk=race.pk).update(opens_at=now + timedelta(days=1))
        tell_what_happened(now=now + timedelta(days=1))
        assert told(racer) == ["opens", "opens"]

    def test_a_cancelled_race_announces_only_its_reason(self, now):
        race = a_race(now, opens_at=now)
        (racer,) = racers(1)
        board(race, [racer])
        cancel_race(race=race, reason="Rain", now=now)
        tell_what_happened(now=now)
        assert tell_what_happened(now=race.closes_at) == 0
        assert told(racer) == ["cancelled"] and sentence(Notice.objects.get()) == f"{race.name} is cancelled: Rain"

    def test_an_owner_is_told_of_a_result(self, now):
        race, racer = a_race(now), a_racer()
        drive(race, racer, laps(9_000, 9_000, 9_000), now)
        tell_what_happened(now=now + HOUR)
        assert told(racer, "result") == ["result"]
        notice = Notice.objects.get(racer=racer, kind="result")
        assert notice.path.startswith("/evaluations/")

    def test_a_racer_is_told_each_time_they_lose_the_lead(self, now):
        race = a_race(now)
        first, second, third = racers(3)
        board(race, [first, second, third])
        tell_what_happened(now=now)
        assert told(second, "lost_lead") == []
        board(race, [second], first_ms=20_000)
        tell_what_happened(now=now)
        tell_what_happened(now=now)
        assert told(first, "lost_lead") == ["lost_lead"] and told(third, "lost_lead") == []
        assert Notice.objects.get(kind="lost_lead").params["leader"] == second.alias

    def test_house_cars_and_deactivated_racers_are_told_nothing(self, now):
        race = a_race(now, opens_at=now)
        house, gone = a_racer(is_house=True), a_racer(is_active=False)
        board(race, [house, gone])
        tell_what_happened(now=now)
        assert not Notice.objects.exists()


class TestSeason:
    def test_every_stage_of_a_season_is_announced(self):
        season = a_season()
        opened, pro = a_round(season, 1, Stage.OPEN), a_round(season, 1, Stage.PRO)
        finale = a_round(season, 1, Stage.FINALE)
        field = racers(10)
        board(opened.race, field)
        board(pro.race, field[:4])
        tell_what_happened(now=opened.race.opens_at)
        now = after(pro)
        close_due_rounds(now=now)
        tell_what_happened(now=now)
        assert told(field[0]) == ["opens", "opens", "promoted", "official", "finale", "official"]
        assert told(field[9]) == ["opens", "official"]
        board(finale.race, field[:3])
        close_due_rounds(now=after(finale))
        tell_what_happened(now=after(finale))
        assert "qualified" in told(field[1]) and "qualified" not in told(field[2])

    def test_outcomes_of_a_round_are_told_once_even_weeks_later(self):
        season = a_season()
        opened, pro = a_round(season, 1, Stage.OPEN), a_round(season, 1, Stage.PRO)
        field = racers(10)
        board(opened.race, field)
        board(pro.race, field[:4])
        now = after(pro)
        close_due_rounds(now=now)
        later = now + timedelta(days=20)
        tell_what_happened(now=later)
        tell_what_happened(now=later)
        assert sorted(told(field[0])) == ["finale", "official", "official", "promoted"]
        assert told(field[9]) == ["official"]
        tell_what_happened(now=now + timedelta(days=29))
        assert sorted(told(field[0])) == ["finale", "official", "official", "promoted"]

    def test_telling_weeks_later_needs_few_queries(self, django_assert_max_num_queries):
        season = a_season()
        opened = a_round(season, 1, Stage.OPEN)
        board(opened.race, racers(10))
        close_due_rounds(now=after(opened))
        tell_what_happened(now=after(opened))
        with django_assert_max_num_queries(20):
            assert tell_what_happened(now=after(opened, days=10)) == 0

    def test_an_open_race_is_announced_to_recently_active_racers(self):
        season = a_season()
        opened = a_round(season, 1, Stage.OPEN)
        now = opened.race.opens_at
        lately, long_ago = racers(2)
        Racer.objects.filter(pk=lately.pk).update(last_login=now - timedelta(days=5))
        Racer.objects.filter(pk=long_ago.pk).update(last_login=now - timedelta(days=90))
        tell_what_happened(now=now)
        assert told(lately) == ["opens"] and told(long_ago) == []


class TestStewardDecision:
    @pytest.fixture
    def month(self):
        """An official round, three racers and a steward."""
        round_, three = a_round(a_season(), 1, Stage.OPEN), racers(3)
        board(round_.race, three)
        close_due_rounds(now=after(round_))
        round_.refresh_from_db()
        return round_, three, a_racer(is_staff=True)

    def test_a_disqualified_racer_reads_the_reason_and_the_deadline(self, month):
        round_, (racer, other, _), steward = month
        now = round_.closed_at + HOUR
        disqualify(round=round_, racer=racer, by=steward, reason="Two accounts", now=now)
        tell_what_happened(now=now)
        notice = Notice.objects.get(kind="disqualified")
        assert (notice.racer, notice.path) == (racer, round_.race.get_absolute_url())
        assert sentence(notice) == (
            f"You are disqualified from {round_.race.name} (Two accounts). If this is a mistake, contact "
            f"the organisers. They can reinstate you until {written(round_.settled_at)}."
        )
        assert "disqualified" not in told(other)

    def test_each_decision_and_its_reversal_are_told_once(self, month):
        round_, (racer, *_), steward = month
        now = round_.closed_at + HOUR
        for turn in range(2):
            disqualify(round=round_, racer=racer, by=steward, reason=f"Reason {turn}", now=now)
            tell_what_happened(now=now)
            assert tell_what_happened(now=now) == 0
            put_back(round=round_, racer=racer, by=steward, reason="Our mistake", now=now + HOUR)
            assert tell_what_happened(now=now + HOUR) >= 1
            assert tell_what_happened(now=now + 2 * HOUR) == 0
        decisions = ["disqualified", "restored"]
        assert [kind for kind in told(racer) if kind in decisions] == decisions * 2
        said = [sentence(one) for one in Notice.objects.filter(kind="restored")]
        assert said == [f"You are no longer disqualified from {round_.race.name} (Our mistake)."] * 2

    def test_before_official_results_no_deadline_is_named(self):
        round_, (racer,) = a_round(a_season(), 1, Stage.OPEN), racers(1)
        board(round_.race, [racer])
        now = round_.race.opens_at + HOUR
        disqualify(round=round_, racer=racer, by=a_racer(is_staff=True), reason="Two accounts.", now=now)
        tell_what_happened(now=now)
        assert sentence(Notice.objects.get(kind="disqualified")).endswith("They can reinstate you.")

    def test_a_notice_after_the_window_names_no_deadline(self, month):
        round_, (racer, *_), steward = month
        disqualify(round=round_, racer=racer, by=steward, reason="Two accounts.", now=round_.closed_at + HOUR)
        tell_what_happened(now=round_.settled_at)
        assert sentence(Notice.objects.get(kind="disqualified")).endswith("(Two accounts.).")

    def test_it_is_mailed_to_a_confirmed_address_unless_turned_off(self, month):
        round_, (reader, off, silent), steward = month
        for racer in (reader, off):
            confirmed(racer)
        choose_notices(racer=off, site_off=["disqualified"], mail_off=["disqualified"], language="en")
        choose_notices(racer=reader, site_off=[], mail_off=["official"], language="ko")
        now = round_.closed_at + HOUR
        for racer in (reader, off, silent):
            disqualify(round=round_, racer=racer, by=steward, reason="Two accounts", now=now)
        tell_what_happened(now=now)
        send_mails(now=now)
        (sent,) = [one for one in mail.outbox if "Two accounts" in one.body]
        assert sent.to == [reader.email] and "실격" in sent.subject and "disqualified" not in sent.body
        assert told(off, "disqualified") == [] and told(silent, "disqualified") == ["disqualified"]

    def test_nothing_is_told_after_thirty_days(self, month):
        round_, (racer, *_), steward = month
        now = round_.closed_at + HOUR
        disqualify(round=round_, racer=racer, by=steward, reason="Two accounts", now=now)
        tell_what_happened(now=now + timedelta(days=30))
        assert told(racer, "disqualified") == []

    def test_a_rolled_back_decision_is_told_to_nobody(self, month):
        round_, (racer, *_), steward = month
        with pytest.raises(UserFault):
            disqualify(round=round_, racer=racer, by=steward, reason=" ", now=round_.closed_at + HOUR)
        tell_what_happened(now=round_.closed_at + HOUR)
        assert told(racer, "disqualified") == []


class TestMail:
    def test_it_is_sent_once_to_confirmed_addresses_in_their_language(self, now):
        race = a_race(now, opens_at=now, name="Night race")
        reader, stranger = confirmed(a_racer()), a_racer()
        choose_notices(racer=reader, site_off=[], mail_off=[], language="ko")
        board(race, [reader, stranger])
        tell_what_happened(now=now)
        assert send_mails(now=now) == 1 and send_mails(now=now) == 0
        (sent,) = mail.outbox
        assert sent.to == [reader.email] and "열렸" in sent.subject and "Night race" in sent.body
        assert race.get_absolute_url() in sent.body and "/settings/notices/" in sent.body

    def test_the_unsubscribe_link_needs_a_post_but_no_log_in(self, now):
        race = a_race(now, opens_at=now)
        reader = confirmed(a_racer())
        choose_notices(racer=reader, site_off=["closes"], mail_off=["result"], language="ko")
        board(race, [reader])
        tell_what_happened(now=now)
        send_mails(now=now)
        (sent,) = mail.outbox
        address = sent.extra_headers["List-Unsubscribe"].strip("<>")
        assert address in sent.body and sent.extra_headers["List-Unsubscribe-Post"] == "List-Unsubscribe=One-Click"
        client = Client(enforce_csrf_checks=True)
        path = urlsplit(address).path
        assert client.get(path).status_code == 200
        assert choice_of(reader).mail_off == ["result"], "looking turns nothing off"
        assert client.post(path, {"List-Unsubscribe": "One-Click"}).status_code == 200
        chosen = choice_of(reader)
        assert chosen.mail_off == ["opens", "result"] and chosen.site_off == ["closes"] and chosen.language == "ko"
        client.post(path)
        assert choice_of(reader).mail_off == ["opens", "result"]

    def test_a_forged_unsubscribe_link_turns_nothing_off(self, alice):
        token = stopping_token(alice.pk, "opens")
        for forged in (token[:-1] + ("A" if token[-1] != "A" else "B"), "x", signing.dumps([alice.pk, "opens"])):
            assert Client().post(f"/notices/stop/{forged}/").status_code == 404
        assert "opens" not in choice_of(alice).mail_off
        Racer.objects.filter(pk=alice.pk).update(is_active=False)
        assert Client().get(f"/notices/stop/{token}/").status_code == 404

    def test_a_name_cannot_inject_a_header(self, now):
        reader = confirmed(a_racer())
        Notice.objects.create(
            racer=reader,
            kind=notice_kinds.OPENS,
            about="x",
            params={"race": "Race\r\nBcc: everybody@example.org"},
            at=now,
        )
        Mail.objects.create(notice=Notice.objects.get())
        assert send_mails(now=now) == 0 and not mail.outbox
        assert Mail.objects.get().state in ("due", "failed")

    def test_a_disabled_kind_is_neither_shown_nor_mailed(self, now):
        race = a_race(now, opens_at=now)
        reader = confirmed(a_racer())
        choose_notices(racer=reader, site_off=["opens"], mail_off=["opens"], language="en")
        board(race, [reader])
        tell_what_happened(now=now)
        assert told(reader) == [] and send_mails(now=now) == 0

    def test_a_kind_may_be_mailed_without_being_shown(self, now):
        race = a_race(now, opens_at=now)
        reader = confirmed(a_racer())
        choose_notices(racer=reader, site_off=["opens"], mail_off=[], language="en")
        board(race, [reader])
        tell_what_happened(now=now)
        assert told(reader) == [] and send_mails(now=now) == 1

    def test_a_refusing_mail_server_is_tried_three_times(self, now, monkeypatch):
        race = a_race(now, opens_at=now)
        board(race, [confirmed(a_racer())])
        tell_what_happened(now=now)

        def refuse(self: object) -> None:
            raise OSError("refused")

        monkeypatch.setattr("league.notices.services.EmailMessage.send", refuse)
        assert [send_mails(now=now + minute * timedelta(minutes=1)) for minute in range(4)] == [0, 0, 0, 0]
        mail_of_it = Mail.objects.get()
        assert mail_of_it.state == "failed" and mail_of_it.attempt == 3

    def test_a_mail_is_not_sent_twice_if_its_sender_is_killed(self, now):
        race = a_race(now, opens_at=now)
        board(race, [confirmed(a_racer())])
        tell_what_happened(now=now)
        lost = MAILS.claim(worker="w", now=now)
        assert send_mails(now=now) == 0 == send_mails(now=now + 2 * LEASE)
        lost.refresh_from_db()
        assert lost.state == "failed" and not mail.outbox

    def test_results_are_mailed_only_on_request(self, now):
        racer = confirmed(a_racer())
        assert "result" in choice_of(racer).mail_off
        drive(a_race(now), racer, laps(9_000, 9_000, 9_000), now)
        tell_what_happened(now=now + HOUR)
        assert not Mail.objects.filter(notice=Notice.objects.get(racer=racer, kind="result")).exists()

    def test_invalid_settings_are_refused(self, alice):
        for site, language in ((["nonsense"], "en"), ([], "xx")):
            with pytest.raises(ValueError):
                choose_notices(racer=alice, site_off=site, mail_off=[], language=language)


class TestPages:
    @pytest.fixture
    def client(self, alice) -> Client:
        client = Client()
        client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
        return client

    def test_the_header_counts_unread_notices_and_the_list_clears_it(self, client, alice, now):
        for number in range(3):
            Notice.objects.create(
                racer=alice, kind=notice_kinds.OPENS, about=str(number), params={"race": "X"}, path="/races/", at=now
            )
        assert 'class="bell-count">3<' in client.get("/about/").content.decode()
        html = client.get("/notices/").content.decode()
        assert html.count("X is open.") == 3
        first = Notice.objects.first()
        assert client.post(f"/notices/{first.pk}/")["Location"] == "/races/"
        assert 'class="bell-count">2<' in client.get("/about/").content.decode()
        client.post("/notices/read/")
        assert "bell-count" not in client.get("/about/").content.decode()

    def test_racers_cannot_read_or_mark_notices_of_others(self, client, bob, now):
        notice = Notice.objects.create(racer=bob, kind=notice_kinds.OPENS, about="1", params={"race": "Y"}, at=now)
        assert "Y is open" not in client.get("/notices/").content.decode()
        assert client.post(f"/notices/{notice.pk}/").status_code == 404
        client.post("/notices/read/")
        notice.refresh_from_db()
        assert notice.read_at is None
        assert Client().get("/notices/").status_code == 302
        assert mark_read(racer=bob, now=now) == 1

    def test_kinds_can_be_turned_off_in_the_settings(self, client, alice):
        page = client.get("/settings/notices/").content.decode()
        assert page.count('type="checkbox"') == 2 * len(notice_kinds.KINDS)
        client.post("/settings/notices/", {"language": "ko", "site_opens": "on", "mail_official": "on"})
        chosen = choice_of(alice)
        assert "opens" not in chosen.site_off and "closes" in chosen.site_off
        assert "official" not in chosen.mail_off and "opens" in chosen.mail_off and chosen.language == "ko"

    def test_an_old_notice_with_a_missing_parameter_is_readable(self, client, alice, now):
        Notice.objects.create(racer=alice, kind=notice_kinds.LOST_LEAD, about="1", at=now)
        assert client.get("/notices/").status_code == 200


@pytest.mark.parametrize(("race", "text"), [("Night", "Night is open."), ("מרוץ 7", "\u2068מרוץ 7\u2069 is open.")])
def test_a_right_to_left_name_is_isolated_in_the_sentence(race: str, text: str) -> None:
    assert sentence(Notice(kind="opens", params={"race": race})) == text
