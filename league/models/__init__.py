"""Racers, seasons with their rounds, what came of the rounds, and what was recorded elsewhere."""

from .notice import Announcement, Lead, Notice, NoticeChoice, NoticeKind
from .outcome import ChampionshipPlace, Decision, FinalePlace, Membership, RoundPoints, StewardDecision
from .racer import ALIAS_PATTERN, ALIAS_VALIDATORS, Racer, RacerManager
from .rating import DuelRating
from .record import RecordedRace, RecordedResult, RecordedSeason
from .season import Round, Season, Stage, StageRules, default_points
from .webhook import Webhook, WebhookDelivery, WebhookHost

__all__ = [
    "ALIAS_PATTERN",
    "ALIAS_VALIDATORS",
    "Announcement",
    "ChampionshipPlace",
    "Decision",
    "DuelRating",
    "FinalePlace",
    "Lead",
    "Membership",
    "Notice",
    "NoticeChoice",
    "NoticeKind",
    "Racer",
    "RacerManager",
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
