"""Texts that others see hold visible characters only, whichever way they come in."""

from __future__ import annotations

import pytest
from django.apps import apps
from django.core.exceptions import ValidationError
from django.db import models, transaction

from accounts.models import RacerGroup
from core.database.columns import MultiLineField, OneLineField, TextRefused
from core.validators import invisible_character, normalized, without_invisible
from paddock.errors import UserFault

OURS = {"accounts", "core", "courses", "evaluation", "league", "races", "tracks", "training", "videos"}
# Why a text is not checked: the fields of each reason.
REASONS = {
    "made by the site, from letters of its own": """
        accounts.ClassLearner.code_digest accounts.KnownAddress.digest accounts.ReservedAlias.digest
        accounts.Racer.avatar accounts.Racer.password
        accounts.Racer.record_id accounts.RacerGroup.code accounts.SignUpInvitation.code accounts.Team.code
        courses.Assignment.draw_seed courses.Assignment.public_id courses.AssignmentPart.pass_rule
        courses.Attempt.public_id
        core.Event.kind core.Event.once core.Event.subject core.EventCursor.reader evaluation.CarReport.direction
        evaluation.CarReport.engine evaluation.CarReport.grade evaluation.CarReport.public_id
        evaluation.CarReport.reason_code evaluation.CarReport.runs_sha256 evaluation.Evaluation.public_id
        evaluation.Evaluation.reason_code evaluation.Network.sha256 evaluation.ReportChunk.engine
        evaluation.ReportChunk.reason_code evaluation.ReportLap.direction evaluation.ReportLap.status
        evaluation.ReportLap.trace_sha256 evaluation.Result.cpu_model evaluation.Result.end_reason
        evaluation.Result.engine evaluation.Result.retired_code evaluation.Result.trace_sha256
        evaluation.RivalResult.end_reason evaluation.RivalResult.retired_code evaluation.RivalResult.trace_sha256
        evaluation.StoredFile.name evaluation.StoredFile.sha256 evaluation.TrainedModel.public_id
        evaluation.TrainedModel.source_kind evaluation.TrainedModel.source_sha256 evaluation.WorkerNode.engine
        league.Mail.state league.MailInvitation.state league.Notice.about league.Notice.kind
        league.Notice.path league.RecordedSeason.digest league.Webhook.old_secret league.Webhook.secret
        league.WebhookDelivery.about
        league.WebhookDelivery.error league.WebhookDelivery.event league.WebhookDelivery.state races.Crossing.boot
        races.DuelCompetitor.retired_code races.Guest.claim races.LiveLog.action races.LiveSlot.reason_code
        races.LiveSlot.speed_reason races.OwnEvaluation.submit_reason_code races.Race.engine races.Race.invitation
        races.Race.next_engine races.RaceCar.car races.Recheck.measured_engine races.Recheck.measured_sha256
        races.Recheck.reason_code races.Redrive.engine races.Retiming.new_engine
        races.Retiming.old_engine races.Retiming.reason_code races.TimingSensor.hint races.TimingSensor.token_sha256
        tracks.ReferenceLap.engine tracks.ReferenceLap.reason_code tracks.ReferenceLap.trace_sha256
        training.Sweep.public_id training.Sweep.reason_code
        training.TrainingJob.action_space_type training.TrainingJob.evaluate_reason_code
        training.TrainingJob.public_id training.TrainingJob.reason_code training.TrainingJob.submit_reason_code
        courses.LtiScore.reason_code
        training.Vehicle.public_id videos.Video.fingerprint videos.Video.language videos.Video.public_id
        videos.Video.reason_code videos.Video.sha256
    """,
    "read by operators only": """
        courses.LtiScore.operator_detail courses.LtiScore.request_id courses.LtiScore.worker
        core.DiscardedFile.name
        evaluation.Evaluation.request_id evaluation.ReportChunk.request_id training.TrainingJob.request_id
        videos.Video.request_id
        core.WorkerHold.worker evaluation.WorkerNode.cpu_model races.Recheck.measured_cpu
        races.Recheck.operator_detail races.Recheck.request_id
        races.Recheck.worker
        evaluation.Evaluation.operator_detail evaluation.Evaluation.worker evaluation.ReportChunk.operator_detail
        evaluation.ReportChunk.worker evaluation.WorkerNode.name league.Mail.worker league.MailInvitation.worker
        league.WebhookDelivery.worker training.TrainingJob.operator_detail training.TrainingJob.worker
        tracks.ReferenceLap.operator_detail tracks.ReferenceLap.request_id tracks.ReferenceLap.worker
        videos.Video.operator_detail videos.Video.worker
    """,
    "a copy of a checked text": """
        accounts.Team.key courses.Attempt.model_name league.RoundPoints.team league.WebhookDelivery.body
        races.RaceTerms.text
    """,
    "ASCII by its own validator": """
        accounts.PastAlias.alias
        accounts.Racer.alias accounts.Racer.country evaluation.TrainedModel.colour league.RecordedSeason.label
        league.RoundPoints.country tracks.Track.fingerprint training.TrainingJob.colour training.Vehicle.colour
    """,
    "an address, checked by Django, and seen by its owner and admins only": """
        accounts.Racer.email league.MailInvitation.email league.NoInvitations.email
    """,
    "an id or an address of a learning platform": """
        courses.LtiAccount.sub courses.LtiContext.context_id courses.LtiContext.deployment_id
        courses.LtiContext.lineitems_url courses.LtiLine.url courses.LtiPlatform.audience
        courses.LtiPlatform.authorize_url courses.LtiPlatform.client_id courses.LtiPlatform.issuer
        courses.LtiPlatform.jwks_url courses.LtiPlatform.token_url
    """,
    "an address; its owner alone reads it": """
        league.Webhook.host league.Webhook.url league.WebhookHost.host
    """,
    "an answer that was given, kept for a repeated request": """
        core.StoredAnswer.digest core.StoredAnswer.request core.StoredAnswer.body
    """,
    "a code, or a copy of a checked text, in an entry that never changes": """
        core.AuditEntry.action core.AuditEntry.program core.AuditEntry.target_kind core.AuditEntry.target_id
        core.AuditEntry.target_name core.AuditEntry.request core.AuditEntry.network
    """,
    "the name of a time zone, from a list": """
        courses.Assignment.time_zone league.Season.zone races.LiveEvent.time_zone
    """,
    "source code: changing one character may change the reward": """
        training.TrainingJob.reward_code
    """,
    "output of a racer's program; the listener keeps its printable characters": """
        training.TrainingJob.log training.TrainingJob.printed
    """,
}
EXEMPT = {name: reason for reason, names in REASONS.items() for name in names.split()}

INVISIBLE = [
    *(
        "\u202a",
        "\u202b",
        "\u202c",
        "\u202d",
        "\u202e",
        "\u2066",
        "\u2067",
        "\u2068",
        "\u2069",
        "\u061c",
        "\u200e",
        "\u200f",
    ),
    *("\u200b", "\u200c", "\u200d", "\u2060", "\ufeff", "\u00ad", "\u034f", "\u3164", "\u115f", "\u2800", "\u180e"),
    *("\U000e0001", "\U000e0041", "\U000e007f", "\U000e0100", "\ufe00", "\ufe0f", "\ufff9"),
    *("\x00", "\x07", "\x1b", "\x7f", "\x9f", "\ud800", "\ue000", "\U000f0000", "\u0378", "\uffff"),
]
VISIBLE = [
    *(
        "Monaco",
        "שלום",
        "مرحبا بالعالم",
        "한국어 이름",
        "Ωé",
        "हिन्दी",
        "ไทย",
        "日本語",
        "¡Olé!",
        "<b>&amp;",
        "12 %",
        "🇰🇷",
    ),
    *("👨‍👩‍👧", "❤️‍🔥", "1️⃣", "🏳️‍🌈", "🧑🏽‍🚀", "©️", "ℹ️", "👍🏽", "🧑‍⚕️", "⛹🏽‍♂️", "🏃‍♀️‍➡️", "🫨"),
]


def _texts():
    for model in apps.get_models():
        if model._meta.app_label in OURS:
            for field in model._meta.local_fields:
                if isinstance(field, models.CharField | models.TextField) and not field.choices:
                    yield f"{model._meta.label}.{field.name}", field


def test_every_text_of_a_model_is_checked_or_says_why_not() -> None:
    checked = {name for name, field in _texts() if isinstance(field, OneLineField | MultiLineField | models.SlugField)}
    every = {name for name, _field in _texts()}
    assert sorted(every - checked) == sorted(EXEMPT)
    assert all(EXEMPT.values())


@pytest.mark.parametrize("place", ["{}ab", "a{}b", "ab{}", "א{}ב", "{}"])
def test_an_invisible_character_is_named(place: str) -> None:
    for mark in INVISIBLE:
        text, name = place.format(mark), f"U+{ord(mark):04X}"
        assert invisible_character(text, lines=False) == invisible_character(text, lines=True) == name
        assert not invisible_character(without_invisible(text)), name


@pytest.mark.parametrize("text", VISIBLE)
def test_texts_of_every_script_are_taken(text: str) -> None:
    assert not invisible_character(text) and without_invisible(text) == normalized(text)


@pytest.mark.parametrize(
    "text", ["▶\ufe0f\ufe0f", "👨\u200d\u200d👩", "👨\u200da", "a\u200d👨", "🏴\U000e0067\U000e007f", "👨\u200d"]
)
def test_emoji_hide_nothing(text: str) -> None:
    assert invisible_character(text)


@pytest.mark.parametrize("mark", ["\n", "\r", "\t", "\v", "\f", "\u2028", "\u2029", "\x85"], ids=ascii)
def test_only_line_ends_and_tabs_stand_in_texts_of_several_lines(mark: str) -> None:
    assert invisible_character(f"a{mark}b")
    assert bool(invisible_character(f"a{mark}b", lines=True)) == (mark not in "\n\t")
    assert not invisible_character("a\r\nb", lines=True)


def test_spellings_are_stored_as_one() -> None:
    assert normalized("e\u0301\u00a0x\u3000y\r\n") == "\u00e9 x y\n"


@pytest.mark.django_db
class TestRows:
    @pytest.fixture
    def group(self, alice, now) -> RacerGroup:
        return RacerGroup.objects.create(name="Kart", slug="kart", leader=alice, made_at=now)

    def test_validation_and_every_way_of_saving_refuse_it(self, group: RacerGroup, now) -> None:
        group.name, group.description = "Kart\u202e", "a\nb\u200b"
        with pytest.raises(ValidationError) as refused:
            group.full_clean()
        assert {name: [one.code for one in errors] for name, errors in refused.value.error_dict.items()} == {
            "name": ["text_character"],
            "description": ["text_character"],
        }
        assert "U+202E" in str(refused.value) and "U+200B" in str(refused.value)
        with pytest.raises(TextRefused) as fault, transaction.atomic():
            group.save()
        assert isinstance(fault.value, UserFault) and fault.value.code == "text_character"
        assert fault.value.params == {"character": "U+202E"} and set(fault.value.errors.error_dict) == {"name"}
        with pytest.raises(TextRefused), transaction.atomic():
            group.save(update_fields=["description"])
        with pytest.raises(TextRefused), transaction.atomic():
            RacerGroup.objects.bulk_create([RacerGroup(name="\u2066", slug="x", made_at=now)])
        with pytest.raises(TextRefused) as fault, transaction.atomic():
            RacerGroup.objects.create(name="a\nb", slug="x", made_at=now)
        assert fault.value.code == "one_line"
        group.refresh_from_db()
        assert group.name == "Kart"

    def test_a_stored_text_of_before_stays_and_its_row_can_be_changed(self, group: RacerGroup) -> None:
        RacerGroup.objects.filter(pk=group.pk).update(name="Kart\u202e")
        group.refresh_from_db()
        group.description = "New"
        group.full_clean()
        group.save()
        group.name = "Kart\u202e!"
        with pytest.raises(TextRefused), transaction.atomic():
            group.save()
        group.name = "קארט"
        group.full_clean()
        group.save()

    def test_names_are_composed(self, group: RacerGroup) -> None:
        group.name = "Cafe\u0301"
        group.full_clean()
        group.save()
        group.refresh_from_db()
        assert group.name == "Café" and RacerGroup.objects.filter(name="Cafe\u0301").exists()

    def test_migrations_know_the_plain_fields(self) -> None:
        paths = {type(field): field.deconstruct()[1] for _name, field in _texts()}
        assert (
            paths[OneLineField] == "django.db.models.CharField"
            and paths[MultiLineField] == "django.db.models.TextField"
        )
