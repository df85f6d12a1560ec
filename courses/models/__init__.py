"""Assignments of a class or a group with their parts, attempts and marks."""

from .assignment import (
    Assignment,
    AssignmentPart,
    Counts,
    Extension,
    PartTrack,
    ReferenceRow,
    Shows,
    SubmissionGroup,
    SubmissionGroupMember,
    TrackKind,
)
from .attempt import Attempt, AttemptRun, RefundKind, RunState
from .lti import LtiAccount, LtiContext, LtiLine, LtiPlatform, LtiScore, LtiScoreState
from .mark import Mark, Regrade
