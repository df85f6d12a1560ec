"""Racers, groups, teams, classes, follows, quotas, invitations to sign up, known addresses and grants of tokens."""

from .access import MOST, KnownAddress, RacerQuota, SignUpInvitation, TokenGrant
from .classroom import ClassLearner, Classroom, ClassTeacher
from .follow import Follow
from .group import GroupMember, RacerGroup
from .racer import ALIAS_PATTERN, ALIAS_VALIDATORS, Racer, RacerManager, Viewer
from .team import Team, TeamInvitation, TeamMember
