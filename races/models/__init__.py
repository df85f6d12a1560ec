"""Races, their entries and submissions."""

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
    LiveReaction,
    LiveSlot,
    LiveState,
    ReactionKind,
    SlotPhase,
    SlotState,
)
from .race import Race, new_invitation
from .recheck import Elsewhere, Recheck, RecheckState
from .redrive import Redrive, RedriveState, Retiming
from .rules import default_sensors
from .service_day import ServiceDay
from .submission import RaceCar, RefusedCar, Submission, car_of
from .terms import RaceTerms, TermsAcceptance
from .test_run import OwnEvaluation
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
