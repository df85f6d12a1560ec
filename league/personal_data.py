"""Personal data of the league."""

from core.personal_data.retention import RetentionPolicy
from core.personal_data.rules import NOBODY, OF_THE_RACE, OTHERS, SECRET, Leaving, PersonalData, register

from . import models as league


def _erase(leaving: Leaving) -> None:
    """Delete what names the racer's addresses: invitations to them, and their refusal of more."""
    league.MailInvitation.objects.filter(email__in=leaving.names).delete()
    league.NoInvitations.objects.filter(email__in=leaving.names).delete()


register(
    "league",
    PersonalData(league.CupPlace, owner="racer", anonymised="racer", section="cup_places"),
    PersonalData(league.CupStarter, owner="racer", rows=True, section="cup_car"),
    PersonalData(
        league.MailInvitation,
        owner="accepted_by",
        rows=True,
        anonymised="made_by",
        section="invitations_accepted",
        exported="email",
        withheld={OTHERS: "made_by"},
    ),
    PersonalData(league.NoInvitations, erased="email"),
    PersonalData(
        league.Notice, owner="racer", rows=True, mentions="params", section="notices", exported="about params path"
    ),
    PersonalData(
        league.NoticeChoice, owner="racer", rows=True, section="notice_settings", exported="site_off mail_off"
    ),
    PersonalData(league.Lead, owner="racer", anonymised="racer", section="races_led"),
    PersonalData(league.Season, kept={NOBODY: "name points prizes"}),
    PersonalData(league.StageRules, kept={NOBODY: "rules"}),
    PersonalData(league.Round, kept={NOBODY: "name"}),
    PersonalData(league.Membership, owner="racer", anonymised="racer", section="divisions"),
    PersonalData(league.FinalePlace, owner="racer", anonymised="racer", section="finale_places"),
    PersonalData(league.ChampionshipPlace, owner="racer", anonymised="racer", section="championship_places"),
    PersonalData(
        league.RoundPoints,
        owner="racer",
        anonymised="racer",
        kept={"Standings of countries and teams are summed from it.": "country team"},
        section="points",
        exported="country team",
    ),
    PersonalData(
        league.StewardDecision,
        owner="racer",
        anonymised="racer by",
        kept={"It is the published reason of an official decision.": "reason"},
        mentions="reason",
        section="steward_decisions",
        exported="reason",
        withheld={"It names a steward.": "by"},
    ),
    PersonalData(league.DuelRating, owner="racer", anonymised="racer", section="ratings"),
    PersonalData(league.RecordedSeason, kept={NOBODY: "label digest"}),
    PersonalData(league.RecordedRace, kept={OF_THE_RACE: "row heading decimals"}),
    PersonalData(
        league.RecordedResult,
        kept={"Racers of imported seasons have no account here; the season goes as a whole.": "alias status division "}
        | {"It lists the empty columns of the imported file.": "blank"},
    ),
    PersonalData(
        league.Webhook,
        owner="owner",
        rows=True,
        section="webhooks",
        exported="url host events",
        withheld={SECRET: "secret old_secret"},
    ),
    PersonalData(
        league.WebhookDelivery,
        owner="webhook__owner",
        rows=True,
        mentions="body",
        withheld={"Deliveries are kept for some days, and name other racers.": "*"},
    ),
    PersonalData(league.WebhookHost, kept={"It is the server of anybody's webhooks.": "host"}),
    erase=_erase,
    policies=[
        RetentionPolicy(
            "notices", "NOTICES_KEPT_DAYS", lambda before, now: league.Notice.objects.filter(at__lt=before)
        ),
        RetentionPolicy(
            "mail_invitations",
            "MAIL_INVITATIONS_KEPT_DAYS",
            lambda before, now: league.MailInvitation.objects.filter(expires_at__lt=before),
        ),
        RetentionPolicy(
            "webhook_deliveries",
            "WEBHOOK_DELIVERIES_KEPT_DAYS",
            lambda before, now: league.WebhookDelivery.objects.filter(at__lt=before, state__in=("sent", "failed")),
        ),
    ],
)
