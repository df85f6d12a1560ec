"""Racers, groups of them, who follows whom, what an admin has set for single ones, invitations to sign up, where racers
have logged in from, and what their tokens may do."""

from .access import MOST, KnownAddress, RacerQuota, SignUpInvitation, TokenGrant
from .classroom import ClassLearner, Classroom, ClassTeacher
from .follow import Follow
from .group import GroupMember, RacerGroup
from .racer import ALIAS_PATTERN, ALIAS_VALIDATORS, Racer, RacerManager
from .team import Team, TeamInvitation, TeamMember

__all__ = [
    "ALIAS_PATTERN",
    "ALIAS_VALIDATORS",
    "MOST",
    "ClassLearner",
    "ClassTeacher",
    "Classroom",
    "Follow",
    "GroupMember",
    "KnownAddress",
    "Racer",
    "RacerGroup",
    "RacerManager",
    "RacerQuota",
    "SignUpInvitation",
    "Team",
    "TeamInvitation",
    "TeamMember",
    "TokenGrant",
]
