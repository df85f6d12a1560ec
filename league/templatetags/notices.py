"""The bell in the head of every page, and what a notice says."""

from __future__ import annotations

from django import template

from accounts.models import Racer
from league.models import Notice
from league.notices import sentence
from league.selectors.notices import notices_of

register = template.Library()
MOST = 99


@register.simple_tag
def unread_notices(racer: Racer) -> str:
    """How many notices a racer has not read, as it stands beside the bell: empty for none, at most ``99+``."""
    count = notices_of(racer).filter(read_at=None)[: MOST + 1].count()
    return f"{MOST}+" if count > MOST else str(count or "")


@register.filter
def notice_text(notice: Notice) -> str:
    """What the notice says, in the reader's language."""
    return sentence(notice)
