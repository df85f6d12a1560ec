"""Parses chunked request bodies as strictly as request heads (:mod:`config.serving.request_head`)."""

import re

from waitress.receiver import ChunkedReceiver
from waitress.utilities import BadRequest

_TOKEN = rb"[!#$%&'*+\-.^_`|~0-9A-Za-z]+"
_QUOTED = rb'"[\t \x21\x23-\x5b\x5d-\x7e\x80-\xff]*"'
_SIZE_LINE = re.compile(rb"([0-9a-fA-F]{1,16})((?:;" + _TOKEN + rb"(?:=(?:" + _TOKEN + rb"|" + _QUOTED + rb"))?)*)")
LINE_BYTES = 256
EXTENSION_BYTES = 4096  # of one request


class ChunkedBody(ChunkedReceiver):
    """Takes chunks with short extensions, which it ignores, and without trailers."""

    _line = b""
    _is_data_read = False  # and its CRLF comes next
    _is_last = False
    _extensions = 0

    def received(self, data: bytes) -> int:
        """How many of the bytes belong to this body. Sets ``error`` for what is malformed."""
        given, at = self._line + data, 0
        self._line = b""
        while at < len(given) and not self.completed and self.error is None:
            if self.chunk_remainder:
                piece = given[at : at + self.chunk_remainder]
                self.buf.append(piece)
                at += len(piece)
                self.chunk_remainder -= len(piece)
                self._is_data_read = not self.chunk_remainder
                continue
            end = given.find(b"\r\n", at, at + LINE_BYTES + 2)
            if end < 0:
                self._keep(given[at:])
                return len(data)
            self._end_line(given[at:end])
            at = end + 2
        return len(data) - (len(given) - at) if self.error is None else len(data)

    def _keep(self, unfinished: bytes) -> None:
        """Keep the beginning of a line, if it may still become one."""
        is_empty_line = self._is_data_read or self._is_last
        if len(unfinished) > LINE_BYTES or (is_empty_line and unfinished != b"\r"):
            self.error = BadRequest("A chunk is malformed.")
        self._line = unfinished

    def _end_line(self, line: bytes) -> None:
        if self._is_data_read or self._is_last:
            if line:
                self.error = BadRequest("A chunk does not end, or a trailer follows the last one.")
            self.completed, self._is_data_read = self._is_last, False
            return
        size = _SIZE_LINE.fullmatch(line)
        self._extensions += len(size[2]) if size else 0
        if size is None or self._extensions > EXTENSION_BYTES:
            self.error = BadRequest("The size of a chunk is malformed.")
            return
        self.chunk_remainder = int(size[1], 16)
        self._is_last = not self.chunk_remainder
