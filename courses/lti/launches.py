"""The claims of a launch that are read here: person, role, course and assignment."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Final

from core.validators import without_invisible
from paddock.errors import UserFault

from ..models import LtiPlatform
from ..models.lti import LONGEST_ID

if TYPE_CHECKING:
    from .library import Message

CLAIM = "https://purl.imsglobal.org/spec/lti/claim"
DEEP_LINKING: Final = "https://purl.imsglobal.org/spec/lti-dl/claim/deep_linking_settings"
GRADES = "https://purl.imsglobal.org/spec/lti-ags/claim/endpoint"
# roles in the course alone: somebody may teach elsewhere at the institution
_MEMBERSHIP = "http://purl.imsglobal.org/vocab/lis/v2/membership"
_TEACHER = re.compile(rf"(?:{re.escape(_MEMBERSHIP)}(?:#Instructor|/Instructor#\w+)|Instructor)")
_STUDENT = re.compile(rf"(?:{re.escape(_MEMBERSHIP)}(?:#Learner|/Learner#\w+)|Learner)")
LONGEST_NAME, LONGEST_URL, MOST_ROLES = 80, 500, 100


@dataclass(frozen=True)
class Launch:
    """``sub``: the person's id on the platform; ``assignment``: the id that our link carries; ``line``, ``lines`` and
    ``scopes``: the service for marks, empty where there is none."""

    platform: int
    deployment: str
    sub: str
    name: str
    context: str
    title: str
    is_teacher: bool
    assignment: str = ""
    line: str = ""
    lines: str = ""
    scopes: tuple[str, ...] = ()

    def kept(self) -> dict[str, object]:
        """As values that a cache keeps; :func:`Launch` takes them again."""
        return asdict(self)


def read_launch(platform: LtiPlatform, message: "Message") -> Launch:
    """Raises UserFault("lti_message" | "lti_no_course" | "lti_role")."""
    claims: Mapping[str, object] = message.get_launch_data()
    context, grades = _mapping(claims.get(f"{CLAIM}/context")), _mapping(claims.get(GRADES))
    if not context.get("id"):
        raise UserFault("lti_no_course")
    sub = _text(claims.get("sub"))
    return Launch(
        platform=platform.pk,
        deployment=_text(claims.get(f"{CLAIM}/deployment_id")),
        sub=sub,
        name=_line(claims.get("name"))
        or _line(" ".join(_items([claims.get("given_name"), claims.get("family_name")]))),
        context=_text(context["id"]),
        title=_line(context.get("title")) or _line(context.get("label")),
        is_teacher=is_teacher(claims.get(f"{CLAIM}/roles")),
        assignment=_line(_mapping(claims.get(f"{CLAIM}/custom")).get("assignment")),
        line=_url(grades.get("lineitem")),
        lines=_url(grades.get("lineitems")),
        scopes=tuple(filter(None, map(_url, _items(grades.get("scope")))))[:10],
    )


def is_teacher(roles: object) -> bool:
    """Whether these roles are a teacher's in the course; False: a student's. Raises UserFault("lti_role") for
    neither."""
    named = _items(roles)[:MOST_ROLES]
    if any(_TEACHER.fullmatch(role) for role in named):
        return True
    if any(_STUDENT.fullmatch(role) for role in named):
        return False
    raise UserFault("lti_role")


def _mapping(found: object) -> dict[str, object]:
    return found if isinstance(found, dict) else {}


def _items(found: object) -> list[str]:
    return [one for one in found if isinstance(one, str)] if isinstance(found, Iterable) else []


def _text(found: object) -> str:
    if not isinstance(found, str) or not 0 < len(found) <= LONGEST_ID or not found.isprintable():
        raise UserFault("lti_message")
    return found


def _line(found: object) -> str:
    """A text for people, in one line and cut."""
    if not isinstance(found, str):
        return ""
    return without_invisible(found[: 10 * LONGEST_NAME])[:LONGEST_NAME].strip()


def _url(found: object) -> str:
    return found if isinstance(found, str) and len(found) <= LONGEST_URL and found.isprintable() else ""
