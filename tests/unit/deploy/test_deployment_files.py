"""What the files of deploy/ promise: services and containers that may do little, a key from a file, a queue per station."""

import re
import shlex
import shutil
import subprocess
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from each import each
from root_process import ROOT
from typer.main import get_command

from pipelines.cli import app
from pipelines.orchestrator import server, worker
from pipelines.serving.connections import MOST
from schemas.safety import SAFE_WITHIN_S
from schemas.station import load_station

DEPLOY = ROOT / "deploy"
UNITS = sorted(path.stem for path in (DEPLOY / "systemd").glob("*.service"))
SERVING = [name for name in UNITS if name != "tumbleline-backup"]
WORKER = "tumbleline-worker@"
SEALED = """
UMask=0077 NoNewPrivileges=yes ProtectSystem=strict ProtectHome=yes PrivateTmp=yes DevicePolicy=closed
ProtectKernelTunables=yes ProtectKernelModules=yes ProtectKernelLogs=yes ProtectControlGroups=yes ProtectClock=yes
ProtectHostname=yes ProtectProc=invisible ProcSubset=pid RestrictNamespaces=yes RestrictRealtime=yes
RestrictSUIDSGID=yes LockPersonality=yes SystemCallArchitectures=native CapabilityBoundingSet= RemoveIPC=yes IPAddressDeny=any
MemoryMax=4G TasksMax=512 KillMode=mixed StateDirectoryMode=0700 User=tumbleline
"""
MOST_EXPOSED = 2.0  # as systemd-analyze counts: 10 is a service without any protection
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
PLANT = yaml.safe_load((DEPLOY / "compose.plant.yaml").read_text(encoding="utf-8"))
SERVICES = COMPOSE["services"]
BOUND = {"init": True, "read_only": True, "cap_drop": ["ALL"], "mem_limit": "4g", "pids_limit": 512}
BOUND |= {"security_opt": ["no-new-privileges:true"]}
ENDING = ("register", "backup")  # containers of one command
PAGES = {
    name: (DEPLOY / f"{name}.md").read_text(encoding="utf-8") for name in ("README", "one-pc", "plant", "containers")
}
CONTAINERFILE = (DEPLOY / "Containerfile").read_text(encoding="utf-8")


def unit(name: str) -> dict[str, dict[str, list[str]]]:
    """Sections of a unit: the values of each key, in order."""
    sections: dict[str, dict[str, list[str]]] = {}
    for line in (DEPLOY / "systemd" / f"{name}.service").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            section = sections.setdefault(line.strip("[]"), defaultdict(list))
        elif line and not line.startswith("#"):
            key, mark, value = line.partition("=")
            assert mark, line
            section[key].append(value)
    return sections


@each(UNITS)
def test_a_service_may_do_little_holds_no_key_and_writes_below_its_own_folders_only(name: str) -> None:
    service = unit(name)["Service"]
    for wanted in SEALED.split():
        key, _, value = wanted.partition("=")
        assert service[key] == [value], wanted
    assert service["SystemCallFilter"] == ["@system-service", "~@privileged @resources"]
    assert service["RestrictAddressFamilies"] == ["AF_INET AF_INET6 AF_UNIX"]
    assert service["IPAddressAllow"][0] == "localhost"
    assert "AUTH_STRING" not in str(service)
    own = [f"/var/lib/{folder}" for folder in service["StateDirectory"][0].split()] + service["ReadWritePaths"]
    written = [value.partition("=")[2] for value in service["Environment"] if "=/var" in value]
    assert written
    assert [path for path in written if not any(path == one or path.startswith(f"{one}/") for one in own)] == []
    if name in SERVING:  # it is started again when it ended, but not for ever
        assert (service["Type"], service["Restart"], service["RestartSec"]) == (["exec"], ["always"], ["10"])
        assert unit(name)["Unit"]["StartLimitIntervalSec"] == ["300"]
        assert unit(name)["Install"]["WantedBy"] == ["multi-user.target"]
    if name in {"tumbleline-server", WORKER, "tumbleline-monitor"}:  # they speak with the orchestrator
        assert "prefect-auth:/etc/tumbleline/prefect-auth" in service["LoadCredential"]
    if name in {"tumbleline-server", "tumbleline-workbench", "tumbleline-monitor"}:
        assert int(service["LimitNOFILE"][0]) >= 4 * MOST


def test_the_image_has_a_user_and_a_worker_and_its_watchdog_have_time_to_end() -> None:
    service = unit(WORKER)["Service"]
    assert "worker stop" in service["ExecStop"][0]
    seconds = 60 * int(service["TimeoutStopSec"][0].removesuffix("min"))
    assert seconds > 10 * SAFE_WITHIN_S
    assert float(re.search(r"--wait (\d+)", service["ExecStop"][0])[1]) < seconds
    assert service["OOMPolicy"] == ["continue"]
    assert re.findall(r"^USER (\S+)$", CONTAINERFILE, re.MULTILINE) == ["tumbleline"]
    worker = SERVICES["worker"]
    assert SERVICES["server"]["ports"] == ["127.0.0.1:4200:4200"]
    assert "--with-healthcheck" in worker["entrypoint"]
    assert worker["environment"]["PREFECT_WORKER_WEBSERVER_HOST"] == "127.0.0.1"
    assert int(worker["stop_grace_period"].removesuffix("m")) * 60 > 10 * SAFE_WITHIN_S
    assert "sh" not in worker["entrypoint"]  # it would not pass SIGTERM on


def without_program(unit_file: Path) -> str:
    """The text of a unit whose programs are one that is there."""
    program = rf"=\1{shutil.which('true')}"
    return re.sub(r"=(-?)/opt/tumbleline/\.venv/bin/\w+", program, unit_file.read_text(encoding="utf-8"))


def said_by_systemd(*words: object) -> tuple[int, str, str]:
    done = subprocess.run(["systemd-analyze", *map(str, words)], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed: parsed above")
@each(UNITS)
def test_systemd_has_nothing_against_a_service(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name.replace('@', '@line-1')}.service"
    path.write_text(without_program(DEPLOY / "systemd" / f"{name}.service"), encoding="utf-8")
    status, _, told = said_by_systemd("verify", path)
    assert (status, [line for line in told.splitlines() if path.name in line]) == (0, [])
    _, judged, why = said_by_systemd("security", "--offline=true", "--no-pager", path)
    level = re.search(r"exposure level for .*: ([\d.]+)", judged)
    assert level, judged + why
    assert float(level[1]) <= MOST_EXPOSED


@each([*SERVICES, "database"])
def test_a_container_may_do_little_and_gets_the_key_as_a_secret(name: str) -> None:
    service = SERVICES.get(name) or PLANT["services"][name]
    assert {key: service[key] for key in BOUND} == BOUND
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))
    assert name in ENDING or (service["healthcheck"]["test"] and service["restart"] == "unless-stopped")
    assert name in ENDING or service["stop_grace_period"]
    if name in SERVICES:
        assert "user" not in service  # that of the image
        assert service["secrets"] == ["prefect-auth"]
        assert service["environment"]["TUMBLELINE_ORCHESTRATOR_KEY"] == "/run/secrets/prefect-auth"
        assert "AUTH_STRING" not in str(service)


def test_every_folder_that_a_container_writes_is_a_named_volume() -> None:
    places = dict(re.findall(r"(TUMBLELINE_ARCHIVE|TUMBLELINE_STATE|PREFECT_HOME)=(\S+)", CONTAINERFILE))
    mounted = {name: dict(v.split(":")[:2] for v in SERVICES[name].get("volumes", [])) for name in SERVICES}
    every = {place for own in mounted.values() for place in own.values()}
    assert places["PREFECT_HOME"] in mounted["server"].values()
    assert {places["TUMBLELINE_ARCHIVE"], places["TUMBLELINE_STATE"]} <= set(mounted["worker"].values())
    assert set(COMPOSE["volumes"]) == {name for own in mounted.values() for name in own}
    [declared] = re.findall(r"^VOLUME (\[[^]]*\])$", CONTAINERFILE, re.MULTILINE)
    assert set(yaml.safe_load(declared.replace("\\\n", ""))) == every
    made = re.search(r"mkdir -p (.*) \\", CONTAINERFILE)[1].split()
    assert {f"/var/lib/{folder}" for folder in made} == every


def test_images_have_a_digest_and_the_database_of_a_plant_its_password_in_a_file() -> None:
    database, server = PLANT["services"]["database"], PLANT["services"]["server"]
    assert re.fullmatch(r"docker\.io/library/postgres@\$\{POSTGRES_DIGEST:\?[^}]+\}", database["image"])
    assert database["user"] == "999:999"
    assert database["environment"]["POSTGRES_PASSWORD_FILE"] == "/run/secrets/postgres-password"
    assert "POSTGRES_PASSWORD" not in database["environment"]
    assert server["environment"]["TUMBLELINE_ORCHESTRATOR_DATABASE"] == "/run/secrets/prefect-database"
    assert re.findall(r"^FROM (\S+)$", CONTAINERFILE, re.MULTILINE) == ["docker.io/library/python@${PYTHON_DIGEST}"]
    assert re.findall(r"^ARG (.*)$", CONTAINERFILE, re.MULTILINE) == ["PYTHON_DIGEST"]  # with no value of its own
    assert all(one["build"]["args"]["PYTHON_DIGEST"].startswith("${PYTHON_DIGEST:?") for one in SERVICES.values())


def test_every_deployment_of_a_lot_is_in_the_queue_of_its_station() -> None:
    deployments = yaml.safe_load((DEPLOY / "prefect.yaml").read_text(encoding="utf-8"))["deployments"]
    queues = {one["name"]: one["work_pool"]["work_queue_name"] for one in deployments}
    station = load_station(DEPLOY / "stations" / "line-1.toml").name
    assert {queues["production-line"], queues["on-demand"]} == {station}
    assert queues["weekly-audit"] != station
    assert "--station %i" in unit(WORKER)["Service"]["ExecStart"][0]
    assert f"tumbleline-worker@{station} tumbleline-worker@{queues['weekly-audit']}" in PAGES["one-pc"]
    assert f"--station={station}" in SERVICES["worker"]["entrypoint"]


def lines() -> list[str]:
    """Every command of the pages, of the units and of the containers."""
    commands = [line[2:] for page in PAGES.values() for line in page.splitlines() if line.startswith("$ ")]
    for path in (*(DEPLOY / "systemd").glob("*.service"), DEPLOY / "plant" / "server.conf"):
        joined = path.read_text(encoding="utf-8").replace("\\\n", " ")
        commands += [line.partition("=")[2].lstrip("-") for line in joined.splitlines() if re.match(r"Exec\w+=.", line)]
    for service in SERVICES.values():
        commands.append(" ".join([*service.get("entrypoint", ["tumbleline"]), *service["command"]]))
    return commands


def test_every_start_of_a_server_or_worker_and_every_command_is_one_that_is_there() -> None:
    matches = [re.search(r"-m pipelines\.orchestrator\.(server|worker) ([^&]*)", text) for text in lines()]
    given = [(match[1], match[2].split()) for match in matches if match]
    assert [module for module, _ in given].count("worker") >= 4
    for module, arguments in given:
        {"server": server, "worker": worker}[module]._parser().parse_args(arguments)
    matches = [re.search(r"(?:^|/)tumbleline ([a-z].*)", text) for text in lines()]
    given = [shlex.split(match[1]) for match in matches if match]
    assert {"station", "workbench", "archive", "doctor", "run"} >= {words[0] for words in given}
    for name, *words in given:
        command = get_command(app).get_command(None, name)._load()
        below = getattr(command, "commands", {})
        leaf, rest = (below[words[0]], words[1:]) if below else (command, words)
        leaf.make_context(name, rest)


@each(PAGES)
def test_what_the_commands_of_a_page_name_is_there(page: str) -> None:
    text = PAGES[page]
    given = "\n".join(line for line in text.splitlines() if line.startswith("$ "))
    for name in re.findall(r"(?<![\w/])(?:/opt/tumbleline/)?(deploy/[\w./@*-]+)", text):
        assert list(DEPLOY.parent.glob(name.rstrip("./"))), name
    for module in re.findall(r"-m ([a-z_.]+)", given):
        assert find_spec(module), module
    units = {path.name for path in (DEPLOY / "systemd").iterdir()}
    for name in re.findall(r"tumbleline-[a-z]+(?:@[a-z0-9-]+)?(?:\.[a-z]+)?", given):
        if "systemctl" in given and name not in {"tumbleline-server.service.d", "tumbleline-worker"}:
            plain = re.sub(r"@[a-z0-9-]+", "@", name)
            assert plain in units or f"{plain}.service" in units, name
    for profile in re.findall(r"run --rm (\w+)", given):
        assert profile in SERVICES


@each(["server.conf", "worker.conf"])
def test_a_drop_in_of_a_plant_changes_its_unit_without_a_remark_of_systemd(name: str, tmp_path: Path) -> None:
    base = {"server.conf": "tumbleline-server", "worker.conf": WORKER}[name]
    text = (DEPLOY / "plant" / name).read_text(encoding="utf-8")
    assert "PASSWORD@" not in re.sub(r"^#.*$", "", text, flags=re.MULTILINE)
    assert all(find_spec(module) for module in re.findall(r"python -m (\S+)", text))
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed: the file is parsed above")
    unit_name = f"{base.replace('@', '@line-1')}.service"
    for source, path in (
        (DEPLOY / "systemd" / f"{base}.service", tmp_path / unit_name),
        (DEPLOY / "plant" / name, tmp_path / f"{unit_name}.d" / "plant.conf"),
    ):
        path.parent.mkdir(exist_ok=True)
        path.write_text(without_program(source), encoding="utf-8")
    status, _, said = said_by_systemd("verify", tmp_path / unit_name)
    assert (status, [line for line in said.splitlines() if "plant.conf" in line or unit_name in line]) == (0, [])
