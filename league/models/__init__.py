"""Seasons with their rounds, what came of the rounds, and what was recorded elsewhere."""

from .cup import Cup, CupDivision, CupPlace, CupStarter
from .invited import MailInvitation, NoInvitations
from .notice import Lead, Mail, Notice, NoticeChoice, NoticeKind
from .outcome import ChampionshipPlace, Decision, FinalePlace, Membership, RoundPoints, StewardDecision
from .rating import DuelRating
from .record import RecordedRace, RecordedResult, RecordedSeason
from .season import Round, Season, Stage, StageRules, default_points
from .webhook import Webhook, WebhookDelivery, WebhookHost

__all__ = [
    "ChampionshipPlace",
    "Cup",
    "CupDivision",
    "CupPlace",
    "CupStarter",
    "Decision",
    "DuelRating",
    "FinalePlace",
    "Lead",
    "Mail",
    "MailInvitation",
    "Membership",
    "NoInvitations",
    "Notice",
    "NoticeChoice",
    "NoticeKind",
    "RecordedRace",
    "RecordedResult",
    "RecordedSeason",
    "Round",
    "RoundPoints",
    "Season",
    "Stage",
    "StageRules",
    "StewardDecision",
    "Webhook",
    "WebhookDelivery",
    "WebhookHost",
    "default_points",
]
