"""Events of assignments. None of them names a track: hidden ones stay hidden."""

from core.events import EventKind, register

ASSIGNMENT_PUBLISHED = register(
    EventKind("assignment.published", "an assignment is published", ("subject",), once="assignment")
)
ASSIGNMENT_DUE = register(
    EventKind("assignment.due", "an assignment is due in less than a day", ("subject",), once="deadline")
)
TRACKS_DRAWN = register(
    EventKind("assignment.drawn", "the hidden tracks of an assignment are drawn", ("subject",), once="assignment")
)
MARKS_COMPLETED = register(EventKind("assignment.marked", "all marks of an assignment are complete", ("subject",)))
MARKS_REGRADED = register(EventKind("assignment.regraded", "marks of an assignment changed by a regrade", ("subject",)))
ATTEMPT_REFUNDED = register(
    EventKind("attempt.refunded", "an attempt was given back", ("racer", "subject"), ("cause",))
)
