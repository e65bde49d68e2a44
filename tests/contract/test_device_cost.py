"""A device of a known family costs one profile, a new family two modules; nothing that is half there passes."""

import shutil
import sys
from pathlib import Path

import pytest
from each import each
from other_devices import station_with
from small_station import lot_of

from docs.devices_page import PAGE, page
from schemas.errors import RecipeInvalid
from stations import profile_files
from stations.devices import families
from stations.devices.adapters import adapter_of, adapters
from stations.devices.chamber import ThermalChamber
from stations.devices.table import TableAxis
from stations.opening import make_plant, open_station
from stations.plant import families as simulated_families
from stations.plant.banks import family_names
from stations.profile_files import load_profile, profile_names

ROOT = Path(__file__).resolve().parents[2]
OF_FAMILIES = [name for name in profile_names() if load_profile(name).kind in {"axis", "chamber"}]
EXAMPLE = (ROOT / "stations" / "profiles" / "watlow_ez_zone.toml").read_text(encoding="utf-8")
ADAPTER = """\
from stations.devices.chamber import AUTOMATIC, ThermalChamber

class AcmeChamber(ThermalChamber):
    needs = ("temperature", "set_point", "enable")

    def mode(self):
        return AUTOMATIC

    def require_ready(self):
        pass

    def order(self, temperature):
        self._values.write("set_point", temperature)
        self._values.write("enable", 1.0)
"""
SIMULATION = """\
from stations.plant.bank import number
from stations.plant.controller import controller_bank

def simulated(world, profile):
    held = {"set_point": 23.0, "enable": 0.0}

    def command(values):
        held.update(values)
        if held["enable"]:
            world.fixture.chamber.set_point = number(held, "set_point")

    own = {"set_point": lambda: held["set_point"], "enable": lambda: held["enable"]}
    return controller_bank(world, profile, own, command)
"""
ENABLE = """
[[registers]]
name = "enable"
address = 4300
manual = "40 4301"
type = "uint16"
access = "read_write"
"""


@pytest.fixture
def product(tmp_path, monkeypatch):
    """Folders for profiles, adapters and simulations to which a test adds files; the product's own are in them."""
    profiles = shutil.copytree(ROOT / "stations" / "profiles", tmp_path / "profiles")
    monkeypatch.setattr(profile_files, "profile_folder", lambda: profiles)
    folders = [profiles]
    for package in (families, simulated_families):
        folder = tmp_path / package.__name__
        folder.mkdir()
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(folder)])
        folders.append(folder)
    yield folders
    for package in (families, simulated_families):
        for module in [name for name in sys.modules if name.startswith(f"{package.__name__}.acme")]:
            del sys.modules[module]
            delattr(package, module.rpartition(".")[2])
    adapters.cache_clear()


def chamber_reaches(profile: str, goal: float) -> float:
    """The air's temperature after an hour at a set point, with the chamber of this profile."""
    with open_station(station_with(chamber=profile), lot_of(1)) as station:
        station.chamber.set_temperature(goal)
        station.clock.sleep(3600.0)
        return station.chamber.temperature()


@each(OF_FAMILIES)
def test_every_profile_has_its_adapter_its_simulated_device_and_its_entry_in_the_reference(name):
    profile = load_profile(name)
    assert adapter_of(profile, profile.kind, {"axis": TableAxis, "chamber": ThermalChamber}[profile.kind])
    config = station_with(**{profile.kind: name})
    plant = make_plant(config, lot_of(1))  # refuses a register without a value of the world behind it
    served = [bank.profile.name for bank in plant.banks.values()]
    assert name in served or (profile.commands and plant.line_devices)
    assert f"\n### {name}\n" in PAGE.read_text(encoding="utf-8"), "write it again: python -m docs.devices_page"


def test_every_family_has_an_adapter_a_simulation_and_a_profile_and_no_other_module_names_it():
    kinds = {name: load_profile(name).kind for name in profile_names()}
    of_profiles = {load_profile(name).adapter for name, kind in kinds.items() if kind not in {"reader", "slot"}}
    assert set(adapters()) == set(family_names()) == of_profiles
    names = set(adapters()) - {"set_point"}  # also the name of a register
    places = [
        (path.relative_to(ROOT).as_posix(), name)
        for folder in ("inertial", "schemas", "stations", "pipelines")
        for path in (ROOT / folder).rglob("*.py")
        for name in names
        if f'"{name}"' in path.read_text(encoding="utf-8")
    ]
    assert places == []


def added(product, family, more="", adapter="", simulation=""):
    """A device of a family added to the product, with modules for a new family."""
    profiles, devices, simulations = product
    text = EXAMPLE.replace('"watlow_ez_zone"', '"acme"').replace('adapter = "set_point"', f'adapter = "{family}"')
    (profiles / "acme.toml").write_text(text + more, "utf-8")
    for folder, text in ((devices, adapter), (simulations, simulation)):
        if text:
            (folder / "acme.py").write_text(text, "utf-8")
    adapters.cache_clear()


def test_a_device_of_a_known_family_is_one_profile_which_is_parsed_once_until_its_file_changes(product):
    added(product, "set_point")
    assert chamber_reaches("acme", -12.3) == pytest.approx(-12.3, abs=0.2)
    assert "### acme\n" in page()
    assert "### acme\n" not in PAGE.read_text("utf-8")  # the check of the reference would fail until it is written
    first = load_profile("acme")
    assert load_profile("acme") is first
    added(product, "set_point", ENABLE)
    assert (first.has("enable"), load_profile("acme").has("enable")) == (False, True)
    with pytest.raises(LookupError, match="acme: the plant has nothing for enable"):
        make_plant(station_with(chamber="acme"), lot_of(1))


def test_a_new_family_is_two_modules_beside_its_profile(product):
    added(product, "acme", ENABLE, ADAPTER, SIMULATION)
    assert chamber_reaches("acme", 40.0) == pytest.approx(40.0, abs=0.2)
    assert "| `acme` | chamber |" in page()


def test_an_unknown_family_and_one_without_its_simulation_or_its_adapter_are_named_with_what_is_missing(product):
    added(product, "watlow_f4z")
    with pytest.raises(RecipeInvalid, match=r"adapter watlow_f4z of kind chamber drives no chamber.*watlow_f4"):
        adapter_of(load_profile("acme"), "chamber", ThermalChamber)
    added(product, "acme", ENABLE, ADAPTER)
    assert set(adapters()) != set(family_names())  # what the contract above compares
    with pytest.raises(
        RecipeInvalid, match=r"known: .*stations/plant/families/acme\.py|did you mean .*families/acme\.py"
    ):
        make_plant(station_with(chamber="acme"), lot_of(1))
    sys.modules.pop(f"{families.__name__}.acme")
    added(product, "acme", ENABLE, "from stations.devices.chamber import ThermalChamber\n# none of its own\n")
    with pytest.raises(LookupError, match=r"stations/devices/families/acme\.py: 0 adapters, 1 is needed"):
        adapters()
