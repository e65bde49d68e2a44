"""The commands of the guide to audits run as they are printed there, on a generated archive."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from in_process import given

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.generated_archive import write_archive
from pipelines.audit.rules import Rules, load_rules
from pipelines.audit.sql import VIEWS

GUIDE = (ROOT / "docs" / "how-to" / "audit.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^\$ (tumbleline .*)$", GUIDE, flags=re.MULTILINE)
RULES = re.findall(r"```toml\n(.*?)```", GUIDE, flags=re.DOTALL)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("guide")
    write_archive(place / "archive", 16, years=1.0, seed=7, workers=1)
    (place / "rules.toml").write_text(RULES, encoding="utf-8")
    return place


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_guide_runs(command, folder, monkeypatch):
    monkeypatch.chdir(folder)
    status, out, err = given(*shlex.split(command)[1:])
    assert status in ({0, 1} if " audit" in command else {0}), err
    assert len(out.splitlines()) > 2


def test_the_guide_s_rules_are_rules(folder):
    rules = load_rules(folder / "rules.toml")
    assert (rules.interval, rules.months("ADXL355"), rules.is_standard("REF-01")) == ("drift", 9, True)


def test_the_built_in_rules_name_every_key():
    text = (ROOT / "pipelines" / "audit" / "default.toml").read_text(encoding="utf-8")
    assert [key for key in Rules.model_fields if key not in text] == []


def test_the_views_of_the_guide_are_there():
    table = GUIDE[GUIDE.index("| view |") : GUIDE.index("`query` needs the extra")]
    assert set(re.findall(r"`(\w+)`", table)) - {"run"} <= set(VIEWS)
