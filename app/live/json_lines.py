"""Lines of JSON of a live run: to a file or pipe, and to robots over a socket."""

from __future__ import annotations

import json
import socket
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from spinscope.pipeline.errors import ParameterError, RecordingError

from ..terminal import note

HOST = "127.0.0.1"
SEND_S = 0.05  # a client that takes no bytes for so long is let go of, for the others must not wait


class JsonLines:
    """File, pipe or standard output ("-") with one object a line, each written at once.

    Raises RecordingError when it cannot be opened or written. Standard output whose reader went away raises
    BrokenPipeError; lines of a named pipe are left out until another one reads.
    """

    def __init__(self, output: str) -> None:
        self._output, self._is_unread = output, False
        if Path(output).is_fifo():
            note(f"waiting for a program that reads the pipe {output}")
        try:
            self._file: BinaryIO = sys.stdout.buffer if output == "-" else open(output, "ab", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise self._error(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._output != "-":
            with suppress(OSError):  # what could not be written was said
                self._file.close()

    def write(self, line: Mapping[str, Any]) -> None:
        """Append an object."""
        left = memoryview(json.dumps(line, allow_nan=False).encode() + b"\n")
        try:
            while len(left):
                left = left[self._file.write(left) :]
            self._file.flush()
        except BrokenPipeError:
            if self._output == "-":
                raise
            if not self._is_unread:
                note(f"nobody reads the pipe any more, lines are left out until somebody does: {self._output}")
            self._is_unread = True
        except OSError as error:
            raise self._error(error) from error
        else:
            self._is_unread = False

    def _error(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"lines cannot be written ({error.strerror}): check free space and rights: {self._output}"
        )


class JsonServer:
    """Server on this machine that sends each line to all clients that are connected; see docs/live.md.

    Parameters
    ----------
    port : int
        0 for a free one; `port` then says which.
    """

    def __init__(self, port: int) -> None:
        self._listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            self._listening.close()
            raise ParameterError(f"port {port} cannot be opened on {HOST} ({error}): give another --socket") from error
        self._listening.listen()
        self.port: int = self._listening.getsockname()[1]
        self._clients: list[socket.socket] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, name="json server", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.close()
        with self._lock:
            for client in self._clients:
                client.close()

    def send(self, line: Mapping[str, Any]) -> None:
        """Send an object to all clients; those that went away or do not read are let go of."""
        if not self._clients:
            return
        content = json.dumps(line, allow_nan=False).encode() + b"\n"
        with self._lock:
            for client in tuple(self._clients):
                try:
                    client.sendall(content)
                except OSError:
                    self._clients.remove(client)
                    client.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:  # closed
                return
            client.settimeout(SEND_S)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                self._clients.append(client)
