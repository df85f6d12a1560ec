"""A counterfeit package index: simple pages, metadata beside the wheels, and wheels of a few kB."""

from __future__ import annotations

import hashlib
import os
import threading
import zipfile
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from urllib.parse import quote, unquote


@dataclass(frozen=True)
class Wheel:
    """A wheel that installs an empty module and ``ballast`` bytes."""

    name: str
    version: str
    tag: str = "py3-none-any"
    requires: tuple[str, ...] = ()
    ballast: int = 0

    @property
    def file(self) -> str:
        return f"{self.name}-{self.version}-{self.tag}.whl"

    @property
    def metadata(self) -> str:
        needs = "".join(f"Requires-Dist: {one}\n" for one in self.requires)
        return f"Metadata-Version: 2.1\nName: {self.name}\nVersion: {self.version}\n{needs}"

    def content(self) -> bytes:
        info = f"{self.name}-{self.version}.dist-info"
        members = {
            f"{self.name}/__init__.py": b"",
            f"{self.name}/ballast": os.urandom(self.ballast),
            f"{info}/METADATA": self.metadata.encode(),
            f"{info}/WHEEL": f"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: {self.tag}\n".encode(),
        }
        members[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*members, f"{info}/RECORD"]).encode()
        packed = BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        return packed.getvalue()


@dataclass
class Index:
    """Serves wheels below ``/<folder>``. ``cut``: after how many bytes a wheel's connection closes; ``hold``: it stays
    open instead until the event is set."""

    cut: int | None = None
    hold: threading.Event | None = None
    asked: list[str] = field(default_factory=list)
    ranges: list[str] = field(default_factory=list)
    wheels: dict[str, dict[str, tuple[Wheel, bytes]]] = field(default_factory=dict)
    reached: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> Index:
        index = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:  # the base class's name
                index.answer(self)

            def log_message(self, *arguments: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        threading.Thread(target=self.server.serve_forever, args=(0.02,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.server.shutdown()
        self.server.server_close()

    def url(self, folder: str) -> str:
        return f"http://127.0.0.1:{self.server.server_port}/{folder}"

    def add(self, folder: str, wheel: Wheel) -> str:
        """Offer the wheel. Returns its SHA-256."""
        content = wheel.content()
        self.wheels.setdefault(folder, {})[wheel.file] = (wheel, content)
        return hashlib.sha256(content).hexdigest()

    def fetched(self) -> list[str]:
        """The wheels that were downloaded."""
        return [name for name in (path.rsplit("/", 1)[-1] for path in self.asked) if name.endswith(".whl")]

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        path = unquote(request.path)
        self.asked.append(path)
        folder, _, rest = path.strip("/").partition("/")
        offered = self.wheels.get(folder, {})
        name = rest.removesuffix(".metadata")
        if name in offered:
            wheel, content = offered[name]
            if rest != name:
                self._send(request, wheel.metadata.encode())
            else:
                self._send_part(request, content)
            return
        links = [
            f'<a href="../{quote(file)}#sha256={hashlib.sha256(content).hexdigest()}"'
            f' data-dist-info-metadata="true">{file}</a><br>'
            for file, (wheel, content) in offered.items()
            if wheel.name.replace("_", "-") == rest
        ]
        self._send(request, "".join(links).encode(), 200 if links else 404)

    def _send(self, request: BaseHTTPRequestHandler, content: bytes, status: int = 200) -> None:
        request.send_response(status)
        request.send_header("Content-Type", "text/html")
        request.send_header("Content-Length", str(len(content)))
        request.end_headers()
        request.wfile.write(content)

    def _send_part(self, request: BaseHTTPRequestHandler, content: bytes) -> None:
        asked = request.headers.get("Range")
        begin = int(asked.removeprefix("bytes=").rstrip("-")) if asked else 0
        self.ranges.append(asked or "")
        request.send_response(206 if asked else 200)
        request.send_header("Content-Length", str(len(content) - begin))
        request.end_headers()
        request.wfile.write(content[begin : self.cut])
        if self.hold:
            request.wfile.flush()
            self.reached.set()
            self.hold.wait(30)
