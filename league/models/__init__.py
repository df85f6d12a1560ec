"""Seasons with their rounds, what came of the rounds, and what was recorded elsewhere."""

from .cup import Cup, CupDivision, CupPlace, CupStarter
from .invited import MailInvitation, NoInvitations
from .notice import Lead, Mail, Notice, NoticeChoice
from .outcome import ChampionshipPlace, Decision, DuelRating, FinalePlace, Membership, RoundPoints, StewardDecision
from .record import RecordedRace, RecordedResult, RecordedSeason
from .season import Round, Season, Stage, StageRules, default_points
from .webhook import Webhook, WebhookDelivery, WebhookHost
