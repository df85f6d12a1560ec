"""Personal data of races: results stay, without the name."""

from django.db.models import JSONField

from core.personal_data.rules import OF_THE_RACE, OTHERS, SECRET, PersonalData, register

from . import models as races

_LOG = " ".join(column.name for column in races.LiveLog._meta.fields if isinstance(column, JSONField))

register(
    "races",
    PersonalData(races.WatchedRace, owner="racer", rows=True, section="watched_races"),
    PersonalData(races.Timekeeper, owner="racer", rows=True, section="timekeeping"),
    PersonalData(races.RefusedCar, owner="racer", rows=True, section="refused_cars"),
    PersonalData(
        races.OwnEvaluation,
        owner="owner",
        rows=True,
        section="test_runs",
        exported="submit_reason_params",
    ),
    PersonalData(
        races.Race,
        owner="organiser",
        erased="organiser",
        kept={OF_THE_RACE: "rules boxes sensors name description prize sponsor terms cancel_reason"},
        section="races_organised",
        exported="rules boxes sensors name description prize sponsor terms cancel_reason",
    ),
    PersonalData(races.RaceTerms, kept={OF_THE_RACE: "text"}),
    PersonalData(
        races.Entry,
        owner="racer",
        erased="removal_reason",
        anonymised="racer",
        kept={"Only entries of guests have one, who have no account.": "guest_name", OF_THE_RACE: "sectors"},
        section="entries",
        exported="removal_reason guest_name sectors",
    ),
    PersonalData(races.Submission, owner="entry__racer", section="submissions"),
    PersonalData(races.DuelCompetitor, owner="entry__racer", section="duels"),
    PersonalData(
        races.Retiming,
        owner="entry__racer",
        kept={OF_THE_RACE: "reason_params"},
        section="retimings",
        exported="reason_params",
    ),
    PersonalData(races.TermsAcceptance, owner="entry__racer", section="accepted_terms"),
    PersonalData(
        races.LiveEvent,
        anonymised="planned_by",
        kept={OF_THE_RACE: "message"},
        mentions="message",
    ),
    PersonalData(
        races.LiveRacer,
        owner="entry__racer",
        anonymised="deputy",
        kept={OF_THE_RACE: "speed"},
        section="live_events",
        exported="speed",
        withheld={OTHERS: "deputy"},
    ),
    PersonalData(races.LiveSlot, kept={OF_THE_RACE: "speed_log speed_next speed_wish"}),
    PersonalData(
        races.LiveLog,
        anonymised="by",
        kept={OF_THE_RACE: _LOG},
        mentions=_LOG,
    ),
    PersonalData(
        races.Guest,
        owner="entry__racer",
        anonymised="name",
        kept={"Its link can no longer be used once an account has the results.": "claim"},
        section="claimed_guests",
        exported="name",
        withheld={SECRET: "claim"},
    ),
    PersonalData(
        races.TimingSensor,
        anonymised="made_by",
        kept={"It names a device.": "name", SECRET: "token_sha256 hint"},
    ),
    PersonalData(
        races.TimedSession,
        owner="entry__racer",
        erased="car",
        anonymised="timekeeper",
        section="timed_sessions",
        exported="car",
        withheld={OTHERS: "timekeeper"},
    ),
    PersonalData(
        races.MeasuredLap,
        owner="session__entry__racer",
        kept={OF_THE_RACE: "note"},
        section="measured_laps",
        exported="note",
    ),
    PersonalData(
        races.LapCorrection,
        owner="lap__session__entry__racer",
        anonymised="by",
        kept={"It is the reason of a corrected result.": "reason before after"},
        mentions="reason",
        section="lap_corrections",
        exported="reason before after",
        withheld={OTHERS: "by"},
    ),
)
