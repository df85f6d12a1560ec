"""A real S3 server (moto's) in this process, that can be stopped, slow, full, or lie."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from moto.backends import get_backend
from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import BaseWSGIServer, WSGIRequestHandler, make_server

KEY = {"access_key": "a-key", "secret_key": "a-secret"}
BUCKET = "paddock"
SLOW_S = 1.5  # longer than anybody in a test waits
FULL = (
    b'<?xml version="1.0" encoding="UTF-8"?><Error><Code>XMinioStorageFull</Code>'
    b"<Message>Storage backend has reached its minimum free drive threshold.</Message></Error>"
)
MOODS = ("stopped", "slow", "full", "lying", "short")


class _Silent(WSGIRequestHandler):
    def log(self, *args: Any) -> None:
        pass


class S3Server:
    """Moto's server on a port of this machine, and how it is: ``""`` or one of :data:`MOODS`. What it keeps stays when
    it stops."""

    def __init__(self) -> None:
        get_backend("s3").reset()
        self._moto = DomainDispatcherApplication(create_backend_app)
        self._mood = ""
        self.puts = 0
        self._server = self._start(0)
        self.address = f"http://127.0.0.1:{self._server.port}"

    def be(self, mood: str) -> None:
        """Be so from here on; ``""``: as it should be."""
        if self._mood == "stopped" != mood:
            self._server = self._start(self._server.port)
        if mood == "stopped" != self._mood:
            self._stop()
        self._mood = mood

    def close(self) -> None:
        """End for good."""
        self.be("")
        self._stop()

    def options(self) -> dict[str, Any]:
        """For Django's storage of files: the site's own, with less patience."""
        from botocore.config import Config

        patience = Config(connect_timeout=0.5, read_timeout=0.5, retries={"mode": "standard", "total_max_attempts": 1})
        return {"bucket_name": BUCKET, "endpoint_url": self.address, "client_config": patience, **KEY}

    def _start(self, port: int) -> BaseWSGIServer:
        server = make_server("127.0.0.1", port, self._answer, threaded=True, request_handler=_Silent)
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        return server

    def _stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def _answer(self, environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        method = environ["REQUEST_METHOD"]
        self.puts += method == "PUT"
        if self._mood == "slow":
            time.sleep(SLOW_S)
        if self._mood == "full" and method in ("PUT", "POST"):
            environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
            start_response("507 Insufficient Storage", [("Content-Type", "application/xml")])
            return [FULL]
        answer = self._moto(environ, start_response)
        return self._spoiled(answer) if method == "GET" and self._mood in ("lying", "short") else answer

    def _spoiled(self, answer: Iterable[bytes]) -> Iterator[bytes]:
        content = b"".join(answer)
        if b"<?xml" in content[:64]:  # a listing, or that there is no such file
            yield content
        elif self._mood == "short":  # and the connection is closed
            yield content[: len(content) // 2]
        else:
            yield bytes(byte ^ 1 for byte in content)
