"""A race, who is in it, and what they sent."""

from .car import RaceCar, RefusedCar, car_of
from .choices import Division, DuelFormat, Lane, Opponents, RaceKind, RaceState, RaceType, RankingMethod, Visibility
from .counting import BoardCount
from .duel import Draw, Duel, DuelCompetitor, DuelState
from .entry import Entry
from .live import (
    COUNTDOWN,
    PLAYED_BEHIND,
    REVEALED_AFTER,
    LiveEvent,
    LiveLog,
    LiveOrder,
    LiveRacer,
    LiveSlot,
    LiveState,
    SlotPhase,
    SlotState,
)
from .own import OwnEvaluation
from .race import Race, new_invitation
from .redrive import Redrive, RedriveState, Retiming
from .rules import default_sensors
from .submission import Submission
from .terms import RaceTerms, TermsAcceptance

__all__ = [
    "COUNTDOWN",
    "PLAYED_BEHIND",
    "REVEALED_AFTER",
    "BoardCount",
    "Division",
    "Draw",
    "Duel",
    "DuelCompetitor",
    "DuelFormat",
    "DuelState",
    "Entry",
    "Lane",
    "LiveEvent",
    "LiveLog",
    "LiveOrder",
    "LiveRacer",
    "LiveSlot",
    "LiveState",
    "Opponents",
    "OwnEvaluation",
    "Race",
    "RaceCar",
    "RaceKind",
    "RaceState",
    "RaceTerms",
    "RaceType",
    "RankingMethod",
    "Redrive",
    "RedriveState",
    "RefusedCar",
    "Retiming",
    "SlotPhase",
    "SlotState",
    "Submission",
    "TermsAcceptance",
    "Visibility",
    "car_of",
    "default_sensors",
    "new_invitation",
]
