"""Reaching a device by reading alone: its address, its id, the order of words and bytes, and addresses counted from one."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from schemas.errors import LinkLost, NoConnection, OperatorNeeded, StationError, StationRefused, StationTimeout
from schemas.profile import Profile, Register
from schemas.station_devices import Device
from stations.bringup.person import Findings, Person
from stations.bringup.plausible import best_order, depends_on_order, votes
from stations.bringup.target import Target, moved
from stations.links.gate import GatedLink

FIRST_IDS = (*range(1, 17), 247, 255)  # where makers put their devices; others are found with ``--device-id``
BAUDS = (19200, 9600, 38400, 57600, 115200)
PROBES = 6
SHIFTS = (0, -1, 1)
OTHER_SPACE = {"holding": "input", "input": "holding"}
MISSING = "bring-up: nothing answers"


@dataclass
class Answer:
    """The answers of a device with some id to reads of the registers of the profile."""

    device_id: int
    words: dict[str, list[int]]
    refused: dict[str, str]
    shift: int = 0
    space: str = ""

    votes: tuple[int, int] = (0, 0)

    @property
    def score(self) -> int:
        """Registers that are there and plausible, less those that are not."""
        good, bad = self.votes
        return good - 2 * bad - len(self.refused)


def reach(target: Target, findings: Findings, person: Person, *, given_id: int, search_line: bool = False) -> None:
    """Finds the device, and leaves ``target`` with the id, addresses and word order at which it answers plausibly.

    given_id : device id that the person has named; 0 to look for it
    search_line : whether speed and parity of a serial line are to be found as well
    Raises StationError: nothing answers, or several devices could be meant.
    """
    if target.text:
        first = target.profile.commands[0]
        found = target.values().text(first.name)
        findings.add("reach", "lines", "held", f"{first.ask} is answered by '{found}'")
        return
    answers = _answers(target, given_id, search_line=search_line, person=person)
    best = _best(target, answers, given_id)
    target.link.device = target.link.device.model_copy(update={"device_id": best.device_id})
    how = "" if given_id else "found by reading the identity registers"
    findings.add("reach", "device id", "held", f"{best.device_id}", how)
    if best.shift or best.space:
        target.moved(best.shift, best.space)
        way = "higher" if best.shift > 0 else "lower"
        found = [f"every address is {abs(best.shift)} {way}"] if best.shift else []
        found += [f"the registers are {best.space} registers"] if best.space else []
        remedy = "the manual counts from one, or names the registers by another function; see the corrected profile"
        findings.add("reach", "addresses", "differs", "; ".join(found), "those of the profile", remedy)
        for register in target.profile.registers:
            findings.change(register.name, "address", register.address)
            if best.space:
                findings.change(register.name, "space", best.space)
    else:
        answered = f"{len(best.words)} of {len(best.words) + len(best.refused)} identity registers answer"
        findings.add("reach", "addresses", "held", answered)
    _order_of_words(target, findings, best.words)
    for point in findings.points:
        person.tell(f"{point.verdict}: {point.what}: {point.found}")


def readable(profile: Profile) -> list[Register]:
    """The registers that can be read, in order of address."""
    return sorted((r for r in profile.registers if r.access != "write"), key=lambda r: (r.space, r.address))


def probes(profile: Profile) -> list[Register]:
    """The registers that say most about who answers: texts, named values, then values of two words with a unit."""

    def worth(register: Register) -> int:
        number = depends_on_order(register) and bool(register.unit)
        named = 3 * bool(register.enumeration) + bool(register.bits)
        return 4 * (register.type == "string") + named + 2 * number

    return sorted(readable(profile), key=worth, reverse=True)[:PROBES]


def _answers(target: Target, given_id: int, *, search_line: bool, person: Person) -> list[Answer]:
    """The answers of all ids, at the first line setting with any answer."""
    ids = [given_id] if given_id else list(FIRST_IDS)
    for device in _settings(target.link.device, search_line=search_line):
        target.link.device = device
        if device.link == "rtu":
            person.tell(
                f"looking on {device.serial}, {device.baud} Bd, parity {device.parity}, {device.stop_bits} stop bits"
            )
        link = target.link.registers()
        found = [answer for number in ids if (answer := _at(link, target.profile, number)) is not None]
        if found:
            return found
    where = target.link.device.serial or f"{target.link.device.host}:{target.link.device.port}"
    tried = ", ".join(map(str, ids)) if given_id else f"{ids[0]} to 16, 247 or 255"
    raise StationTimeout(
        f"{MISSING} at {where} under id {tried}, a device with the registers of {target.profile.name} is needed; check power, "
        "cable and address, and give --device-id as its panel shows it"
    )


def _settings(device: Device, *, search_line: bool) -> Iterator[Device]:
    yield device
    if device.link == "rtu" and search_line:
        for baud in BAUDS:
            for parity in ("even", "none", "odd"):
                if (baud, parity) != (device.baud, device.parity):
                    yield device.model_copy(update={"baud": baud, "parity": parity})


def _at(link: GatedLink, profile: Profile, device_id: int) -> Answer | None:
    """What answers at an id: at the addresses of the profile, else shifted by one or in the other space; None for silence."""
    stated = _read(link, profile, device_id, probes(profile))
    if stated is None:
        return None
    if stated.words and stated.votes[1] <= stated.votes[0] and len(stated.refused) < len(stated.words):
        return stated
    spaces = {r.space for r in profile.registers}
    others = [*((shift, "") for shift in SHIFTS[1:])]
    if len(spaces) == 1 and (other := OTHER_SPACE.get(next(iter(spaces)))):
        others += [(shift, other) for shift in SHIFTS]
    tried = [stated]
    for shift, space in others:
        if min(r.address for r in profile.registers) + shift < 0:
            continue
        answer = _read(link, profile, device_id, moved(probes(profile), shift, space))
        if answer is not None:
            answer.shift, answer.space = shift, space
            tried.append(answer)
    return max(tried, key=lambda answer: (answer.score, answer is stated))


def _read(link: GatedLink, profile: Profile, device_id: int, registers: Sequence[Register]) -> Answer | None:
    """The words of registers at one id; None where it is silent, or a gateway says that nobody is there."""
    answer = Answer(device_id, {}, {})
    for register in registers:
        try:
            answer.words[register.name] = link.read(
                device_id, register.address, register.words, register.name, register.space
            )
        except StationTimeout:
            return None
        except StationRefused as problem:
            answer.refused[register.name] = str(problem)
        except NoConnection:
            raise  # no device can be there, whatever its id
        except LinkLost:
            return answer if answer.words or answer.refused else None
    if answer.words:
        order, counted = best_order(profile, answer.words)
        order = order or max(counted, key=lambda o: counted[o][0] - 3 * counted[o][1])
        answer.votes = votes(profile, answer.words, order, orderly=False)
    return answer


def _best(target: Target, answers: Iterable[Answer], given_id: int) -> Answer:
    """The answer that is of the profile; between several equally good answers the person decides."""
    ranked = sorted(answers, key=lambda answer: -answer.score)
    best = ranked[0]
    alike = [answer.device_id for answer in ranked if answer.score == best.score]
    if len(alike) == len(FIRST_IDS):  # it answers under any id, as many servers on TCP do
        return min((answer for answer in ranked if answer.score == best.score), key=lambda answer: answer.device_id)
    if len(alike) > 1 and not given_id:
        raise OperatorNeeded(
            f"bring-up: devices {', '.join(map(str, alike))} answer alike to the registers of {target.profile.name}, one of them "
            "is needed; give --device-id"
        )
    if not best.words:
        some = next(iter(best.refused.values()), "")
        raise StationRefused(
            f"bring-up: device {best.device_id} answers, and has none of the registers of {target.profile.name} ({some}); name "
            "the profile of this device ('tumbleline station profiles' lists them), or write one"
        )
    return best


def _order_of_words(target: Target, findings: Findings, probed: dict[str, list[int]]) -> None:
    """The order of words and bytes, from every register of two words."""
    words, registers = dict(probed), target.registers()
    for register in readable(target.profile):
        if depends_on_order(register) and register.name not in words:
            with suppress(StationError):
                words[register.name] = registers.raw(register.name)
    profile = target.profile
    if not any(depends_on_order(profile.register(name)) for name in words):
        some = any(map(depends_on_order, profile.registers))
        told = "no register of two words can be read" if some else "every value of the profile is in single words"
        findings.add("reach", "word order", "not tried" if some else "held", told)
        return
    order, counted = best_order(profile, words)
    seen = ", ".join(f"{name}: {good} plausible, {bad} not" for name, (good, bad) in counted.items())
    if order is None:
        remedy = "move the axis, or wait for another temperature, and repeat; the profile's order is used"
        findings.add("reach", "word order", "not tried", f"the values do not tell ({seen})", profile.word_order, remedy)
    elif order == profile.word_order:
        findings.add("reach", "word order", "held", order, profile.word_order)
    else:
        remedy = "set word_order of the device in the station's file, or use the corrected profile"
        findings.add("reach", "word order", "differs", f"{order} ({seen})", profile.word_order, remedy)
        target.ordered(order)
        findings.change("", "word_order", order)
