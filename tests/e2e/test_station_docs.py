"""The station's guides say what is so."""

import re
import tomllib
from pathlib import Path

from docs.devices_page import PAGE, page
from schemas.profile import parse_profile
from schemas.station_devices import Device
from stations.devices.adapters import adapters, chamber_adapter
from stations.plant.hidden import HIDDEN
from stations.plant.preset import load_preset
from stations.plant.sampler import Sampler

DOCS = Path(__file__).resolve().parents[2] / "docs"
GUIDE = (DOCS / "how-to" / "add-a-device.md").read_text(encoding="utf-8")
STATION = (DOCS / "explanation" / "simulated-station.md").read_text(encoding="utf-8")


def test_profile_of_the_guide_is_a_profile():
    text = re.findall(r"```toml\n(.*?)```", GUIDE, re.DOTALL)[0]
    profile = parse_profile(text, "guide")
    assert [register.name for register in profile.registers] == ["temperature", "set_point"]

    assert chamber_adapter(profile) is adapters()["set_point"]


def test_links_of_the_guide_are_those_of_a_station():
    blocks = re.findall(r"```toml\n(\[devices.*?)```", GUIDE, re.DOTALL)
    links = [Device.model_validate(next(iter(tomllib.loads(text)["devices"].values()))) for text in blocks]
    assert [device.link for device in links] == ["rtu", "tls"]
    assert not any(device.missing() for device in links)


def test_the_reference_of_devices_is_what_the_profiles_say():
    assert PAGE.read_text(encoding="utf-8") == page(), "write it anew: python -m docs.devices_page"


def test_every_hidden_effect_is_told_of():
    for kind in HIDDEN:
        assert f"`{kind}`" in STATION


def test_capacities_and_counts_are_those_of_the_text():
    assert Sampler(None, 1, "int20x3", 48000).capacity == 12000
    assert Sampler(None, 1, "int24x3", 48000).capacity == 9600
    qa700 = load_preset("QA700")
    assert round(1e6 * qa700.lsb / qa700.scale, 1) == 3.9
