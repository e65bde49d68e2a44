"""What a recorded device answers: to the same requests the same answers, in their order.

A device is followed through its recording by the orders that it gets. Between two orders a client may read more or less often
than the recorded one did: a read gets the next recorded answer before the next order, and after the last one that answer again.
What was never asked while it was recorded has no answer, and is listed.
"""

from bisect import bisect_left
from collections import defaultdict
from dataclasses import dataclass, field

from stations.recordings.frame_file import Exchange, FrameFile

Who = tuple[str, int]


@dataclass
class _Followed:
    """Where a device is in its recording."""

    orders: list[int] = field(default_factory=list[int])
    by_request: dict[bytes, list[int]] = field(default_factory=lambda: defaultdict(list))
    next: int = 0


@dataclass
class Replay:
    """The devices of a recording; ``asked_anew`` is what was asked and is not in it."""

    exchanges: list[Exchange]
    asked_anew: list[str] = field(default_factory=list[str])
    answered: int = 0
    _devices: dict[Who, _Followed] = field(default_factory=lambda: defaultdict(_Followed))

    def __post_init__(self) -> None:
        """Sorts the exchanges by device and request."""
        for number, exchange in enumerate(self.exchanges):
            device = self._devices[exchange.link, exchange.device_id]
            device.by_request[exchange.request].append(number)
            if exchange.writes:
                device.orders.append(number)

    @classmethod
    def of(cls, recording: FrameFile) -> "Replay":
        """The devices of a recording."""
        return cls(recording.exchanges)

    @property
    def who(self) -> list[Who]:
        """Link and device id of every device, in order of their first exchange."""
        return list(self._devices)

    def answer(self, who: Who, request: bytes) -> Exchange | None:
        """The recorded exchange that this request continues with; None where it was never recorded."""
        device = self._devices.get(who)
        numbers = device.by_request.get(request, []) if device is not None else []
        if device is None or not numbers:
            self.asked_anew.append(f"{who[0]} device {who[1]}: {request.hex(' ')}")
            return None
        k = bisect_left(numbers, device.next)
        order = bisect_left(device.orders, device.next)
        until = device.orders[order] if order < len(device.orders) else len(self.exchanges)
        self.answered += 1
        if k < len(numbers) and (self.exchanges[numbers[k]].writes or numbers[k] < until):
            device.next = numbers[k] + 1
            return self.exchanges[numbers[k]]
        return self.exchanges[numbers[max(k - 1, 0)]]
