"""What the files of deploy/ promise: services and containers that may do little, a key from a file, a queue per station."""

import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
import yaml

from pipelines.flows import server, worker
from schemas.safety import SAFE_WITHIN_S
from schemas.station import load_station

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
UNITS = ["tumbleline-server", "tumbleline-worker"]
SEALED = """
Type=exec UMask=0077 NoNewPrivileges=yes ProtectSystem=strict ProtectHome=yes PrivateTmp=yes DevicePolicy=closed
ProtectKernelTunables=yes ProtectKernelModules=yes ProtectKernelLogs=yes ProtectControlGroups=yes ProtectClock=yes
ProtectHostname=yes ProtectProc=invisible ProcSubset=pid RestrictNamespaces=yes RestrictRealtime=yes
RestrictSUIDSGID=yes LockPersonality=yes SystemCallArchitectures=native CapabilityBoundingSet= RemoveIPC=yes IPAddressDeny=any
MemoryMax=4G TasksMax=512 Restart=always RestartSec=10 KillMode=mixed StateDirectoryMode=0700
LoadCredential=prefect-auth:/etc/tumbleline/prefect-auth User=tumbleline
"""
MOST_EXPOSED = 2.0  # as systemd-analyze counts: 10 is a service without any protection
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
SERVICES = COMPOSE["services"]
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


@pytest.mark.parametrize("name", UNITS)
def test_a_service_may_do_little(name: str) -> None:
    service = unit(name)["Service"]
    for wanted in SEALED.split():
        key, _, value = wanted.partition("=")
        assert service[key] == [value], wanted
    assert service["SystemCallFilter"] == ["@system-service", "~@privileged @resources"]
    assert service["RestrictAddressFamilies"] == ["AF_INET AF_INET6 AF_UNIX"]
    assert service["IPAddressAllow"][0] == "localhost"
    assert unit(name)["Unit"]["StartLimitIntervalSec"] == ["300"]


@pytest.mark.parametrize("name", UNITS)
def test_a_service_holds_no_key_and_writes_below_its_own_folders_only(name: str) -> None:
    service = unit(name)["Service"]
    assert "AUTH_STRING" not in str(service)
    own = [f"/var/lib/{folder}" for folder in service["StateDirectory"][0].split()]
    written = [value.partition("=")[2] for value in service["Environment"] if "=/var" in value]
    assert written
    assert [path for path in written if not any(path == one or path.startswith(f"{one}/") for one in own)] == []


def test_the_worker_is_asked_to_stop_and_its_watchdog_has_time() -> None:
    service = unit("tumbleline-worker")["Service"]
    assert "worker stop" in service["ExecStop"][0]
    minutes = re.fullmatch(r"(\d+)min", service["TimeoutStopSec"][0])
    assert minutes
    assert 60 * int(minutes[1]) > 10 * SAFE_WITHIN_S
    assert float(re.search(r"--wait (\d+)", service["ExecStop"][0])[1]) < 60 * int(minutes[1])
    assert service["OOMPolicy"] == ["continue"]


@pytest.mark.skipif(
    not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed: the files are parsed above"
)
@pytest.mark.parametrize("name", UNITS)
def test_systemd_has_nothing_against_a_service(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.service"
    text = (DEPLOY / "systemd" / path.name).read_text(encoding="utf-8")
    path.write_text(
        re.sub(r"=(-?)/opt/tumbleline/\.venv/bin/python", rf"=\1{shutil.which('true')}", text), encoding="utf-8"
    )
    verified = subprocess.run(["systemd-analyze", "verify", path], capture_output=True, text=True, check=False)
    told = [line for line in verified.stderr.splitlines() if path.name in line]
    assert (verified.returncode, told) == (0, [])
    judged = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", path],
        capture_output=True,
        text=True,
        check=False,
    )
    level = re.search(r"exposure level for .*: ([\d.]+)", judged.stdout)
    assert level, judged.stdout + judged.stderr
    assert float(level[1]) <= MOST_EXPOSED


@pytest.mark.parametrize("name", SERVICES)
def test_a_container_may_do_little(name: str) -> None:
    service = SERVICES[name]
    assert service["init"] is True
    assert service["read_only"] is True
    assert service["tmpfs"] == ["/tmp"]
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["mem_limit"] == "4g"
    assert service["pids_limit"] == 512
    assert service["secrets"] == ["prefect-auth"]
    assert service["environment"]["TUMBLELINE_ORCHESTRATOR_KEY"] == "/run/secrets/prefect-auth"
    assert "AUTH_STRING" not in str(service)


def test_containers_listen_on_loopback_are_looked_at_and_have_time_to_end() -> None:
    server, worker = SERVICES["server"], SERVICES["worker"]
    assert server["ports"] == ["127.0.0.1:4200:4200"]
    assert "--with-healthcheck" in worker["entrypoint"]
    assert worker["environment"]["PREFECT_WORKER_WEBSERVER_HOST"] == "127.0.0.1"
    assert all(service["healthcheck"]["test"] for service in (server, worker))
    assert int(worker["stop_grace_period"].removesuffix("m")) * 60 > 10 * SAFE_WITHIN_S
    assert "sh" not in worker["entrypoint"]  # it would not pass SIGTERM on


def test_every_folder_that_a_container_writes_is_a_named_volume() -> None:
    places = dict(re.findall(r"(TUMBLELINE_ARCHIVE|TUMBLELINE_STATE|PREFECT_HOME)=(\S+)", CONTAINERFILE))
    mounted = {name: dict(v.split(":") for v in SERVICES[name].get("volumes", [])) for name in ("server", "worker")}
    assert places["PREFECT_HOME"] in mounted["server"].values()
    assert {places["TUMBLELINE_ARCHIVE"], places["TUMBLELINE_STATE"]} <= set(mounted["worker"].values())
    assert set(COMPOSE["volumes"]) == {*mounted["server"], *mounted["worker"]}
    [declared] = re.findall(r"^VOLUME (\[.*\])$", CONTAINERFILE, re.MULTILINE)
    assert set(yaml.safe_load(declared)) == {*mounted["server"].values(), *mounted["worker"].values()}


def test_the_base_image_has_a_digest_or_is_not_built() -> None:
    assert re.findall(r"^FROM (\S+)$", CONTAINERFILE, re.MULTILINE) == ["docker.io/library/python@${PYTHON_DIGEST}"]
    assert re.findall(r"^ARG (.*)$", CONTAINERFILE, re.MULTILINE) == ["PYTHON_DIGEST"]  # with no value of its own
    assert {service["build"]["args"]["PYTHON_DIGEST"].partition(":?")[0] for service in SERVICES.values()} == {
        "${PYTHON_DIGEST"
    }


@pytest.mark.skipif(not shutil.which("buildah"), reason="buildah is not installed: the file is parsed above")
@pytest.mark.parametrize(
    "arguments", [[], ["--build-arg", "PYTHON_DIGEST="], ["--build-arg", "PYTHON_DIGEST=3.11-slim"]]
)
def test_a_build_without_a_digest_is_refused(arguments: list[str]) -> None:
    command = ["buildah", "--storage-driver", "vfs", "bud", "--isolation", "chroot", "--pull-never", *arguments]
    done = subprocess.run(
        [*command, "-f", "deploy/Containerfile", "."], cwd=DEPLOY.parent, capture_output=True, text=True, check=False
    )
    assert done.returncode
    assert "invalid reference format" in done.stderr


def test_every_deployment_of_a_lot_is_in_the_queue_of_its_station() -> None:
    deployments = yaml.safe_load((DEPLOY / "prefect.yaml").read_text(encoding="utf-8"))["deployments"]
    queues = {one["name"]: one["work_pool"]["work_queue_name"] for one in deployments}
    station = load_station(DEPLOY / "stations" / "line-1.toml").name
    assert {queues["production-line"], queues["on-demand"]} == {station}
    assert queues["weekly-audit"] != station
    assert f"--station {station}" in unit("tumbleline-worker")["Service"]["ExecStart"][0]
    assert f"--station={station}" in SERVICES["worker"]["entrypoint"]


def commands() -> list[tuple[str, list[str]]]:
    """Every start of a server or worker that the files name: the module and its arguments."""
    texts = [
        line for name in UNITS for line in (DEPLOY / "systemd" / f"{name}.service").read_text("utf-8").splitlines()
    ]
    texts += [line for line in (DEPLOY / "README.md").read_text("utf-8").splitlines() if line.startswith("$")]
    texts += [" ".join(service["entrypoint"]) for service in SERVICES.values()]
    found = [re.search(r"-m pipelines\.flows\.(server|worker) ([^&]*)", text) for text in texts]
    return [(match[1], match[2].split()) for match in found if match]


def test_every_command_of_the_files_is_one_that_is_there() -> None:
    assert [module for module, _ in commands()].count("worker") >= 5
    for module, arguments in commands():
        {"server": server, "worker": worker}[module]._parser().parse_args(arguments)
