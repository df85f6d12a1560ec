"""Sessions in the database, read by a query that is compiled once."""

from typing import Any

from django.contrib.sessions.backends import db
from django.utils import timezone

from core.database.kept_queries import KeptQuery


class SessionStore(db.SessionStore):
    """Django's own; every request of a racer reads one."""

    def _get_session_from_db(self) -> Any:
        row = next(iter(_rows(key=self.session_key)), None) if self.session_key else None
        if row is None or row.expire_date <= timezone.now():
            self._session_key = None
            return None
        return row


_rows: KeptQuery[Any] = KeptQuery(lambda key: db.SessionStore.get_model_class().objects.filter(session_key=key))
