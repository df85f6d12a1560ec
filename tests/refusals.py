"""What a service refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from paddock.errors import UserFault


def refused(code: str, call: Callable[..., object], **arguments: Any) -> UserFault:
    """The fault with the ``code`` that the call ends with; every placeholder of its sentence is filled."""
    with pytest.raises(UserFault) as caught:
        call(**arguments)
    assert caught.value.code == code
    assert "?" not in str(caught.value)
    return caught.value
