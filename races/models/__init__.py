"""A race, who is in it, and what they sent."""

from .car import RaceCar, RefusedCar, car_of
from .choices import (
    Division,
    DuelFormat,
    Lane,
    Opponents,
    RaceKind,
    RaceState,
    RaceType,
    RankingMethod,
    TeamEntries,
    Visibility,
)
from .counting import BoardCount
from .duel import Draw, Duel, DuelCompetitor, DuelState
from .entry import Entry
from .live import (
    COUNTDOWN,
    HEAT_CARS,
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
from .live_reaction import LiveReaction, ReactionKind
from .own import OwnEvaluation
from .race import Race, new_invitation
from .redrive import Redrive, RedriveState, Retiming
from .rules import default_sensors
from .submission import Submission
from .terms import RaceTerms, TermsAcceptance
from .timing import (
    Crossing,
    CrossingVerdict,
    Guest,
    LapCorrection,
    LapNote,
    MeasuredLap,
    Source,
    TimedSession,
    Timekeeper,
    TimingSensor,
)
from .watched import WatchedRace

__all__ = [
    "COUNTDOWN",
    "HEAT_CARS",
    "PLAYED_BEHIND",
    "REVEALED_AFTER",
    "BoardCount",
    "Crossing",
    "CrossingVerdict",
    "Division",
    "Draw",
    "Duel",
    "DuelCompetitor",
    "DuelFormat",
    "DuelState",
    "Entry",
    "Guest",
    "Lane",
    "LapCorrection",
    "LapNote",
    "LiveEvent",
    "LiveLog",
    "LiveOrder",
    "LiveRacer",
    "LiveReaction",
    "LiveSlot",
    "LiveState",
    "MeasuredLap",
    "Opponents",
    "OwnEvaluation",
    "Race",
    "RaceCar",
    "RaceKind",
    "RaceState",
    "RaceTerms",
    "RaceType",
    "RankingMethod",
    "ReactionKind",
    "Redrive",
    "RedriveState",
    "RefusedCar",
    "Retiming",
    "SlotPhase",
    "SlotState",
    "Source",
    "Submission",
    "TeamEntries",
    "TermsAcceptance",
    "TimedSession",
    "Timekeeper",
    "TimingSensor",
    "Visibility",
    "WatchedRace",
    "car_of",
    "default_sensors",
    "new_invitation",
]
