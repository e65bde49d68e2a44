"""The station's guides say what is so."""

import re
from pathlib import Path

from schemas.profile import parse_profile
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


def test_every_hidden_effect_is_told_of():
    for kind in HIDDEN:
        assert f"`{kind}`" in STATION


def test_capacities_and_counts_are_those_of_the_text():
    assert Sampler(None, 1, "int20x3", 48000).capacity == 12000
    assert Sampler(None, 1, "int24x3", 48000).capacity == 9600
    qa700 = load_preset("QA700")
    assert round(1e6 * qa700.lsb / qa700.scale, 1) == 3.9
