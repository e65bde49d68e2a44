"""Bring-ups in tests: a person who answers as told, served devices, and a network that does something to the frames."""

import re
import socket
import threading
from contextlib import contextmanager, suppress

import pytest
from other_devices import station_with
from small_station import lot_of

from stations import opening, serving
from stations.bringup.session import BringUp
from stations.bringup.target import device_at
from stations.profile_files import load_profile

FAMILIES = (
    "oriental_az", "smc_lecp6", "iai_robo_cylinder", "watlow_f4t", "watlow_f4s", "binder_mb1", "binder_mb2", "eurotherm_3200",
    "watlow_ez_zone", "espec_p300", "universal_robots",
)  # fmt: skip
"""A profile of each of the ten families of drives, arms and chambers; Binder has two register maps."""
QUICK = {"silence_s": 2.0, "watch_s": 0.3}


class Scripted:
    """A person who consents to the named words, and reads the panel from a table."""

    def __init__(self, *words, panel=None, seen="", then=None):
        self.words, self.panel, self.seen, self.then = words, panel or {}, seen, then or {}
        self.told, self.asked = [], []

    def tell(self, text):
        self.told.append(text)

    def ask(self, question):
        self.asked.append(question)
        if match := re.search(r"Type (\w+) to allow", question):
            if act := self.then.get(match[1]):
                act()
            return match[1] if match[1] in self.words else ""
        if "panel show as" in question:
            name = re.search(r"show as ([a-z ]+), in", question)[1].replace(" ", "_")
            return str(self.panel.get(name, ""))
        return self.seen if "turned" in question else ""


@contextmanager
def served_device(name, silence_s=1.0, jog_deg=12.0):
    """The built-in station with this drive or chamber, in wall time; gives port and plant. Drives stand at ``jog_deg``."""
    profile = load_profile(name)
    stop, ready, ports, plants = threading.Event(), threading.Event(), [], []
    make = opening.make_plant

    def noted(*args, **more):
        plants.append(make(*args, **more))
        for axis in (plants[-1].outer, plants[-1].inner):
            axis.go(0.0, jog_deg, 90.0, 200.0)
        plants[-1].advance(10_000_000)
        return plants[-1]

    def listening(_host, port):
        ports.append(port)
        ready.set()

    how = {"host": "127.0.0.1", "port": 0, "speed": 1.0, "stop": stop, "ready": listening, "silence_s": silence_s}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(opening, "make_plant", noted)
        thread = threading.Thread(
            target=serving.serve, args=(station_with(**{profile.kind: name}), lot_of()), kwargs=how
        )
        thread.start()
        try:
            assert ready.wait(60.0)
            yield ports[0] + bool(profile.commands), plants[0]
        finally:
            stop.set()
            thread.join(20.0)


def id_of(profile):
    """The device id at which the built-in station has a drive or a chamber."""
    return 1 if profile.kind == "axis" else 3


def brought_up(profile_name, port, person, **changes):
    """A bring-up of the device behind a port, which has run."""
    profile = load_profile(profile_name)
    given = changes.pop("given_id", id_of(profile))
    device = device_at(f"tcp://127.0.0.1:{port}", profile, given or 1)
    bring_up = BringUp(profile, device, person, given, **{**QUICK, **changes})
    bring_up.run()
    return bring_up


def verdicts(bring_up):
    """Every point by its name: verdict and what was found."""
    return {point.what: point.verdict for point in bring_up.findings.points}


class Middle:
    """A proxy between client and device; it delays answers, and can cut the line and refuse for a while."""

    def __init__(self, port, late_s=0.0):
        self.device, self.late_s = port, late_s
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.open, self.threads = [], []
        self.away = False
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        with suppress(OSError):
            while True:
                client, _ = self.listener.accept()
                if self.away:
                    client.close()
                    continue
                device = socket.create_connection(("127.0.0.1", self.device))
                self.open += [client, device]
                for way in ((client, device, 0.0), (device, client, self.late_s)):
                    self.threads.append(threading.Thread(target=self._pass, args=way, daemon=True))
                    self.threads[-1].start()

    def _pass(self, source, target, late_s):
        with suppress(OSError):
            while data := source.recv(4096):
                if late_s:
                    threading.Event().wait(late_s)
                target.sendall(data)
        for one in (source, target):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        source.close()

    def cut(self, away_s=0.0):
        """Ends every connection; new ones are refused for a while, as by a device that restarts."""
        self.away = away_s > 0.0
        for one in self.open:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        self.open.clear()
        if away_s:
            timer = threading.Timer(away_s, self.back)
            timer.daemon = True
            timer.start()

    def back(self):
        self.away = False

    def close(self):
        self.cut()
        for thread in self.threads:
            thread.join(5.0)
        with suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
