"""Names of commands and options of the version before, which are accepted for one release with a line that says the new ones.

A word of the tables stands for itself; ``{}`` is the value of the option. An option whose new name is one word keeps its value
where it is; one that is replaced by several, or by none, goes to the front, so that what is given besides has priority; a value
that becomes an argument goes to the end; ``+--option text`` adds a text to the value of another option.

``--history`` stays beyond that release: other programs are written against it.
"""

from collections.abc import Sequence
from fnmatch import fnmatchcase

from pipelines.cli.groups import SPELLED

COMMANDS: dict[str, str] = {
    "allan": "noise allan",
    "certify": "certificate issue",
    "choose": "plan choose",
    "diff": "archive diff",
    "keys": "plan keys",
    "monitor": "station monitor",
    "operator": "station operator",
    "program": "station program",
    "psd": "noise psd",
    "query": "archive query",
    "report": "show --report",
    "revoke": "certificate revoke",
    "waveforms": "export --waveforms 0",
    "whatif": "release whatif",
}

GROUPS = {"certificate": "write"}
"""Commands that became groups, and the subcommand that does what they did."""


def _set(names: str) -> dict[str, str]:
    return {f"--{name}": f"--set {name}={{}}" for name in names.split()}


_PAGE = {"--page": "--output"}
_MODEL = {"--history": "--temperatures", "--fresh-history": "--fresh-temperatures"}
_SERIES = {"--time": "--map time={}", "--columns": "--map"}
_NOISE = _SERIES | {"--time-unit": "--unit-of time={}", "--unit": "--unit-of output={}", "--plot": "--output", **_PAGE}
_INCLUDE = {"--failed": "--include failed", "--revoked": "--include revoked"}
_SINCE = {"--from": "--since"}
_PLAN = {**_PAGE, "--wander": "+--noise ,{}"}

OPTIONS: dict[str, dict[str, str]] = {
    "archive compact": {"--before": "--until"},
    "archive query": {"--csv": "--output -"},
    "audit": _PAGE,
    "certificate issue": {**_SINCE, "--months": "--until {}m", "--key": "--trust"},
    "certificate write": {"--password-file": "+--sign-with ,{}"},
    "certificate list": {},
    "certificate revoke": {**_SINCE, "--certificate": "{}"},
    "compare": _MODEL,
    "correct": {
        **_SERIES, **_INCLUDE, "--calibration": "{}",
        "--force": "--track {}", "--at-rest": "--track at-rest", "--cutoff": "+--filter :{}",
        **_set("gravity step"), "--turn-on": "--set turn_on={}",
    },
    "demo": {"--effect": "{}", "--archive": "--lots 400", "--auto": "--yes"},
    "diagnose": {"--history": "--temperatures", "--report": "--output", "--next": "--output", **_PAGE},
    "export": {
        **_INCLUDE, "--unit": "--units", "--record": "--waveforms", "--cutoff": "+--filter :{}", "--track": "--set track=yes",
        **_set("nominal sensor arithmetic teds step"), "--device-id": "--set device_id={}",
        "--counts-per-g": "--set counts_per_g={}", "--turn-on": "--set turn_on={}",
    },
    "extend": {"--why": "--reason", "--by": "--who", "--run": "--dwells", "--out": "--output"},
    "history": {**_MODEL, "--picture": "--output"},
    "import": {
        **_set("join group rows axes signs poses headings face positions threshold gaps faulty verify measured"),
        "--mapping": "--set", "--part": "--set", "--units *=*": "--unit-of", "--unit": "--units",
        "--blocks": "--set block_s={}", "--window": "--set window_s={}", "--shortest": "--set shortest_s={}",
        "--local-g": "--set local_gravity_m_s2={}", "--zero-output": "--set zero_output={}", "--list-dwells": "--all",
    },
    "improve": {**_MODEL, "--out": "--output", "--by": "--who", **_set("group")},
    "inspect": {**_set("join group"), "--picture": "--output", **_PAGE},
    "lineage": {"--prov": "--output", "--crate": "--output"},
    "noise allan": _NOISE,
    "noise psd": _NOISE,
    "plan": {**_PLAN, "--pictures": "--output"},
    "plan choose": {f"--{name}": f"{name}={{}}" for name in ("range", "error", "temperature", "bandwidth")},
    "plan optimise": {
        **_PLAN, **_set("factor temperatures poses size separation verification"),
        "--see": "--wanted", "--part": "+--criterion :{}", "--ramp": "--set ramp=yes",
    },
    "release": {**_SINCE, "--list": ""},
    "run": {"--prompts": "--ask", "--no-prompts": "--yes"},
    "simulate": {
        "--calibration": "{}", "--time": "--map time={}", "--units": "--unit-of force={}",
        "--no-noise": "--seed none", "--noise": "", "--failed": "--include failed",
    },
    "station bring-up": {
        **_set("timeout silence watch"), "--link": "{}", "--out": "--output", "--by": "--who", "--readings": "--read-only",
    },
    "station check": {"--registers": "--read-only", "--units": "--slots"},
    "station frames": {"--limit": "--last", **_PAGE, "--as-test": "--output"},
    "station log": {"--limit": "--last"},
    "station monitor": {"--serve": "--port 9464", "--metrics": "--format prometheus", "--days": "--last"},
    "station operator": {"--go": "--answer go", "--stop": "--answer stop"},
    "station program": {
        "--form": "--format", "--tolerance": "--set tolerance={}", "--offset-registers": "--set offset_registers=yes",
    },
    "station serve": {"--units": "--slots", **_set("silence")},
    "station status": {"--watch": "--every 1", "--units": "--slots"},
    "station watch": {"--once": "--every 0", "--minutes": "--last"},
    "verify": {"--key": "--trust"},
    "workbench": {"--certificate": "--tls", "--key": "+--tls ,{}", "--name": "+--host ,{}"},
}  # fmt: skip
"""By command: the option of the version before, with a pattern of its value where that decides, and what it is now."""


def present(words: Sequence[str]) -> list[str]:
    """The words of a command line, with the present names in place of former ones."""
    if not words:
        return []
    name, *front = COMMANDS.get(words[0], words[0]).split()
    rest = [*front, *words[1:]]
    if name in GROUPS and rest and rest[0] not in {"-h", "--help"} and f"{name} {rest[0]}" not in OPTIONS:
        rest = [GROUPS[name], *rest]
    below = " ".join([name, *(SPELLED.get(word, word) for word in rest[:1])])
    path = [name, rest.pop(0)] if below in OPTIONS and rest else [name]
    rules, line = OPTIONS.get(below, OPTIONS.get(name, {})), _Line()
    while rest:
        word = rest.pop(0)
        if word == "--":
            line.middle += [word, *rest]
            break
        option, equals, value = word.partition("=")
        new = _rule(rules, option, value if equals else next(iter(rest), ""))
        if new is None:
            line.middle.append(word)
        elif "{}" in new:
            line.put(new, value if equals or not rest else rest.pop(0))
        elif " " in new or not new:
            line.front += new.split()
        else:
            line.middle.append(f"{new}{equals}{value}")
    return [*path, *line.words()]


class _Line:
    """The words behind the name of a command: constants, those that stay in their place, new arguments, texts to add."""

    def __init__(self) -> None:
        self.front, self.middle, self.behind, self.added = list[str](), list[str](), list[str](), list[list[str]]()

    def put(self, new: str, value: str) -> None:
        """Put the present words for a former option with a value."""
        text = new.replace("{}", value)
        if text.startswith("+"):
            self.added.append(text[1:].split(" ", 1))
        elif text.startswith("-"):
            self.middle += text.split(" ", 1)
        else:
            self.behind.append(text)

    def words(self) -> list[str]:
        """All words of the command line."""
        for option, text in self.added:
            _add(self.middle, option, text)
        return [*self.front, *self.middle, *self.behind]


def _rule(rules: dict[str, str], option: str, value: str) -> str | None:
    """The present words for a former option; None for an option that exists."""
    for stated, new in rules.items():
        name, _, pattern = stated.partition(" ")
        if name == option and (not pattern or fnmatchcase(value, pattern)):
            return new
    return None


def _add(words: list[str], option: str, text: str) -> None:
    """Add a text to the value of an option, which is appended where it is not there."""
    for index, word in enumerate(words):
        if word == option and index + 1 < len(words):
            words[index + 1] += text
            return
        if word.startswith(f"{option}="):
            words[index] += text
            return
    words += [option, text]
