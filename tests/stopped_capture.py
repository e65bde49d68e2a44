"""A sink that ends a capture after some records."""


class Stopped(Exception):
    """The test ends a capture here."""


class Stopping:
    """A sink that ends the capture after some records."""

    def __init__(self, records, count: int) -> None:
        self._records, self._left = records, count

    def __getattr__(self, name: str):
        return getattr(self._records, name)

    def put(self, *args) -> None:
        if self._left == 0:
            raise Stopped
        self._left -= 1
        self._records.put(*args)
