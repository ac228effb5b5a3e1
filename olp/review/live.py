"""The page served on this computer alone, and updated when its inputs change."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from olp.core.errors import OlpError
from olp.review.job import Review
from olp.review.loopback import LOOPBACK, SECRET_BYTES, Loopback

#: Address, relative to the page, at which it asks whether it is out of date.
VERSION = "version"
#: Seconds between checks of the inputs.
WATCH_S = 0.5

Make = Callable[[], Review]
Tell = Callable[[str], None]
_Stamp = tuple[tuple[str, int, int], ...]


class Server:
    """Serves the page of the result of `make` at `address`, and updates it when one of `inputs` changes.

    Where an input is wrong for the moment, the page is kept unchanged, and `tell` gets the reason. Raises
    OlpError where `port` cannot be served, and what `make` raises at first.
    """

    def __init__(self, make: Make, inputs: Iterable[str], tell: Tell, port: int = 0) -> None:
        self._make, self._inputs, self._tell = make, tuple(inputs), tell
        try:
            self._http = Loopback(port)
        except OSError as error:
            raise OlpError(f"port {port} of {LOOPBACK} cannot be served ({error.strerror})") from None
        # it tells the page that an answer is from this server, as another user may take the port after it
        self._proof = secrets.token_urlsafe(SECRET_BYTES)
        self._stamp = self._look()
        try:
            self._set(make())
        except BaseException:
            self._http.server_close()
            raise
        self._ended = threading.Event()

    @property
    def address(self) -> str:
        """The only address of the page. It has a secret: who knows it can read the job."""
        return self._http.address

    def run(self) -> None:
        """Serve until `stop`, or until KeyboardInterrupt, which is raised."""
        thread = threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
        thread.start()
        try:
            while not self._ended.wait(WATCH_S):
                self._refresh()
        finally:
            self._http.shutdown()
            self._http.server_close()
            thread.join()

    def stop(self) -> None:
        self._ended.set()

    def _refresh(self) -> None:
        stamp = self._look()
        if stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            self._set(self._make())
        except OlpError as error:
            self._tell(f"the page is unchanged: {error}")
        else:
            self._tell("the page is up to date again")

    def _look(self) -> _Stamp:
        """Time of the last change and size of each input."""
        return tuple(self._stamps())

    def _stamps(self) -> Iterator[tuple[str, int, int]]:
        for name in self._inputs:
            try:
                status = Path(name).stat()
            except OSError:
                yield name, 0, 0
            else:
                yield name, status.st_mtime_ns, status.st_size

    def _set(self, review: Review) -> None:
        page = b"".join(review.parts(live={"address": VERSION, "proof": self._proof}))
        version = f"{self._proof} {review.scene.digest}".encode()
        self._http.contents = {
            "": ("text/html; charset=utf-8", page),
            VERSION: ("text/plain; charset=utf-8", version),
        }
