"""Racers, programs, groups, teams, classes, follows, quotas, past aliases, invitations and grants of tokens."""

from .access import MOST, KnownAddress, RacerQuota, SignUpInvitation, TokenGrant
from .classroom import ClassLearner, Classroom, ClassTeacher
from .departure import DeletedAccount, PastAlias, ReservedAlias
from .follow import Follow
from .group import GroupMember, RacerGroup
from .program import ServiceAccount
from .racer import ALIAS_PATTERN, ALIAS_VALIDATORS, NAMELESS, Racer, RacerManager, Viewer
from .team import Team, TeamInvitation, TeamMember
