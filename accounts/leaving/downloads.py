"""The download of a racer's personal data."""

from datetime import datetime

from django.conf import settings
from django.http import StreamingHttpResponse

from core.personal_data.exporting import archive
from core.rate_limits import count
from paddock.errors import UserFault

from ..models import Racer


def download_of_data(*, racer: Racer, now: datetime, is_limited: bool = True) -> StreamingHttpResponse:
    """All data of a racer as a zip (:mod:`core.personal_data.exporting`). Raises UserFault("data_too_often")."""
    limit = settings.DATA_DOWNLOADS_A_DAY
    if is_limited and count("accounts:own_data", str(racer.pk), f"{limit}/d") is None:
        raise UserFault("data_too_often", limit=limit)
    response = StreamingHttpResponse(archive(racer, now=now), content_type="application/zip")
    response["Content-Disposition"] = f'attachment; filename="paddock-{racer.alias}-{now:%Y-%m-%d}.zip"'
    response["Cache-Control"] = "private, no-store"
    return response
