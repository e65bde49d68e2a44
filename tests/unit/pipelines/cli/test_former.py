"""Command lines of the version before: what they are now, one line that says so, and the same result."""

import shlex
from collections.abc import Iterator
from pathlib import Path

from each import each
from in_process import command, given
from typed_commands import command_of, known_options
from typer.main import get_command

from pipelines.cli import COMMANDS, app
from pipelines.cli.former import COMMANDS as FORMER
from pipelines.cli.former import OPTIONS, present

NOW = {
    "certify latest --from 2026-01-01 --months 12": "certificate issue latest --since 2026-01-01 --until 12m",
    "certificate latest --password-file p --sign-with k": "certificate write latest --sign-with k,p",
    "certificate --help": "certificate --help",
    "revoke --certificate 2 SN1": "certificate revoke SN1 2",
    "choose --range 4g --error=2mg --device A": "plan choose --device A range=4g error=2mg",
    "waveforms latest --record 7 --unit SN1": "export --waveforms 0 latest --waveforms 7 --units SN1",
    "report latest": "show --report latest",
    "import a.csv --units output=g --unit SN1 --poses a=+x": "import a.csv --unit-of output=g --units SN1 --set poses=a=+x",
    "import a.csv --units SN1": "import a.csv --units SN1",
    "correct a.csv --cutoff 9 --filter=fir --calibration latest:A1": "correct a.csv --filter=fir:9 latest:A1",
    "plan r --noise 25 --wander 8": "plan r --noise 25,8",
    "plan optimise r --criterion T --part a,b --ramp": "plan optimise --set ramp=yes r --criterion T:a,b",
    "monitor --port 9000 --serve": "station monitor --port 9464 --port 9000",
    "extend m.toml --remove x --why -- --why": "extend m.toml --remove x --reason -- --why",
    "release --list": "release",
    "simulate a --no-noise --failed --time t": "simulate --seed none --include failed a --map time=t",
    "": "",
}


@each(NOW)
def test_a_former_command_line_is_the_present_one(line: str) -> None:
    assert shlex.join(present(shlex.split(line))) == NOW[line]
    assert present(shlex.split(NOW[line])) == shlex.split(NOW[line])  # a present one stays


def leaves(command: object, name: str) -> Iterator[tuple[str, object]]:
    below = getattr(command, "commands", {})
    usual = getattr(command, "usual", "")
    for word, leaf in below.items():
        yield (name if word == usual else f"{name} {word}"), leaf
    if not below:
        yield name, command


def test_every_row_of_the_table_leads_from_a_name_that_is_gone_to_one_that_is_there() -> None:
    known = {}
    for name in COMMANDS:
        known |= dict(leaves(get_command(app).get_command(None, name)._load(), name))
    assert set(OPTIONS) <= set(known)
    for former, now in FORMER.items():
        assert former not in COMMANDS
        command_of(now.split())
    for name, rules in OPTIONS.items():
        there = known_options(known[name])
        for former, now in rules.items():
            option, _, pattern = former.partition(" ")
            assert pattern or option not in there, (name, former)
            word = now.removeprefix("+").split(" ")[0]
            assert not word.startswith("-") or word in there, (name, former)


def test_a_former_name_gives_the_same_result_and_one_line_on_standard_error(tmp_path: Path) -> None:
    old, new = command(["keys", "fault", "--json"]), command(["plan", "keys", "fault", "--json"])
    assert (old.returncode, old.stdout) == (new.returncode, new.stdout) == (0, new.stdout)
    assert new.stderr == ""
    assert old.stderr.splitlines() == [
        "tumbleline: former names, accepted for one release; now: tumbleline plan keys fault --json"
    ]
    status, out, err = given("report", "latest", "--archive", tmp_path)
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 2


def test_the_help_has_thirty_commands_and_hundred_options_at_most() -> None:
    assert len(COMMANDS) <= 30
    names = set()
    for name in COMMANDS:
        for _, leaf in leaves(get_command(app).get_command(None, name)._load(), name):
            shown = [one for one in leaf.params if one.param_type_name == "option" and not one.hidden]
            names |= {max(one.opts, key=len) for one in shown}
    assert len(names) <= 100, sorted(names)
