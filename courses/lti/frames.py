"""The few pages that platforms show in frames: without a session, without the buttons of other pages."""

from django.http import HttpResponse


def framed(answer: HttpResponse, origin: str = "") -> HttpResponse:
    """The answer, allowed in frames of ``origin``, which its forms may be sent to; without one in any frame."""
    policy = {"frame-ancestors": [origin], "form-action": [origin]} if origin else {"frame-ancestors": ["*"]}
    answer._csp_replace = policy  # type: ignore[attr-defined]
    answer.xframe_options_exempt = True
    return answer
