"""Events of assignments. None of them names a track: hidden ones stay hidden."""

from core.events import OWN, EventKind, register

# Visible to the teachers and the students of the group.
ASSIGNMENT = "assignment"

ASSIGNMENT_PUBLISHED = register(
    EventKind("assignment.published", "an assignment is published", ASSIGNMENT, ("subject",), once="assignment")
)
ASSIGNMENT_DUE = register(
    EventKind("assignment.due", "an assignment is due in less than a day", ASSIGNMENT, ("subject",), once="deadline")
)
TRACKS_DRAWN = register(
    EventKind(
        "assignment.drawn", "the hidden tracks of an assignment are drawn", ASSIGNMENT, ("subject",), once="assignment"
    )
)
MARKS_COMPLETED = register(
    EventKind("assignment.marked", "all marks of an assignment are complete", ASSIGNMENT, ("subject",))
)
MARKS_REGRADED = register(
    EventKind("assignment.regraded", "marks of an assignment changed by a regrade", ASSIGNMENT, ("subject",))
)
ATTEMPT_REFUNDED = register(
    EventKind("attempt.refunded", "an attempt was given back", OWN, ("racer", "subject"), ("cause",))
)
