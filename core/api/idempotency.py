"""Repeatable writes: the answer to a request with an ``Idempotency-Key`` is stored in the transaction of its write."""

import base64
import json
import re
from datetime import datetime, timedelta
from typing import Any

from cryptography.fernet import Fernet
from django.core.files.uploadedfile import UploadedFile
from django.db import IntegrityError, connection, transaction
from django.http import QueryDict
from django.utils.crypto import salted_hmac
from rest_framework.renderers import JSONRenderer
from rest_framework.request import Request
from rest_framework.response import Response

from .errors import KeyInUse, KeyInvalid, KeyReused
from .models import StoredAnswer

HEADER, REPLAYED = "Idempotency-Key", "Idempotent-Replayed"
KEPT = timedelta(hours=24)
LONGEST = 255
PATTERN = rf"[!-~]{{1,{LONGEST}}}"  # what is visible of ASCII


class Repeat:
    """A request that may be a repetition. Stored are a salted hash of the racer's key and the answer, encrypted with
    it."""

    def __init__(self, request: Request, racer: Any, key: str) -> None:
        self.racer = racer
        about = f"{request.method} {request._request.path_info} {key}"
        self._digest = salted_hmac("idempotency", f"{racer.pk} {about}", algorithm="sha256")
        secret = salted_hmac("stored answer", about, algorithm="sha256").digest()
        self._cipher = Fernet(base64.urlsafe_b64encode(secret))
        self._request = _digest_of(request)

    def hold(self) -> None:
        """Lock the key until the transaction ends. Others wait on SQLite; on PostgreSQL KeyInUse is raised for them."""
        if connection.vendor == "postgresql":
            number = int.from_bytes(self._digest.digest()[:8], "big", signed=True)
            with connection.cursor() as cursor:
                cursor.execute("SELECT pg_try_advisory_xact_lock(%s)", [number])
                if not cursor.fetchone()[0]:
                    raise KeyInUse()

    def stored(self) -> Response | None:
        """The answer to the same request before, if there was one. Raises KeyReused where that was another request."""
        known = StoredAnswer.objects.filter(racer=self.racer, digest=self._digest.hexdigest()).first()
        if known is None:
            return None
        if known.request != self._request:
            raise KeyReused()
        data = json.loads(self._cipher.decrypt(known.body.encode())) if known.body else None
        return Response(data, status=known.status, headers={REPLAYED: "true"})

    def keep(self, response: Response, *, now: datetime) -> None:
        """Store the answer, if it is a success. Raises KeyInUse where somebody else has stored one."""
        if not 200 <= response.status_code < 300:
            return
        body = "" if response.data is None else self._cipher.encrypt(JSONRenderer().render(response.data)).decode()
        answer = StoredAnswer(
            racer=self.racer,
            digest=self._digest.hexdigest(),
            request=self._request,
            status=response.status_code,
            body=body,
            made_at=now,
        )
        try:
            with transaction.atomic():
                answer.save(force_insert=True)
        except IntegrityError:
            raise KeyInUse() from None


def repeat_of(request: Request, racer: Any) -> Repeat | None:
    """The :class:`Repeat` of a logged-in POST with a key; None for any other request. Raises KeyInvalid."""
    key = request.headers.get(HEADER)
    if key is None or request.method != "POST" or not racer.is_authenticated:
        return None
    bare = key[1:-1] if len(key) > 2 and key[0] == key[-1] == '"' else key  # as the IETF's draft writes it
    if re.fullmatch(PATTERN, bare) is None:
        raise KeyInvalid()
    return Repeat(request, racer, bare)


def forget_answers(*, now: datetime) -> int:
    """Delete the answers that were kept for long enough. Returns how many."""
    return StoredAnswer.objects.filter(made_at__lt=now - KEPT).delete()[0]


def _digest_of(request: Request) -> str:
    """What a request asks for: its parameters and the fields of its body, in whatever order and form they came."""
    digest = salted_hmac("request", request._request.META.get("QUERY_STRING", ""), algorithm="sha256")
    sent = request.data
    fields = {name: sent.getlist(name) for name in sorted(sent)} if isinstance(sent, QueryDict) else {"": [sent]}
    for name, parts in fields.items():
        digest.update(b"\1" + json.dumps(name).encode())
        for part in parts:
            if isinstance(part, UploadedFile):
                digest.update(b"\2" + json.dumps([part.name, part.size]).encode())
                for chunk in part.chunks():
                    digest.update(chunk)
                part.seek(0)
            else:
                digest.update(b"\0" + json.dumps(part, sort_keys=True).encode())
    return digest.hexdigest()
