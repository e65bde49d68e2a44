"""Registers the deployments of a ``prefect.yaml`` with their pools and queues: ``prefect deploy --all``, and what that leaves.

A work queue is a station (or something else that does one thing at a time): its limit of one run is set here, as ``prefect.yaml``
has no place for it. A deployment's own limit does not keep two deployments of one station apart.

Prefect 3.8's own command ends in an error 422 from FastAPI 0.151 on: after each deployment it asks for the pool's workers with
null for two numbers, and since then FastAPI takes null for a value and no longer for one that is missing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from pipelines.flows.credentials import refuse_credentials
from pipelines.flows.knock import knock
from pipelines.flows.settings import CLIENT_KEY, use_key
from schemas.errors import TumblelineError

NOT_HERE = "deployments are registered from code that is not asynchronous"
TREE = Path(__file__).resolve().parents[2]
ONE_AT_A_TIME = 1


def register(path: Path) -> list[str]:
    """Names of the deployments of a file, registered with the server that PREFECT_API_URL names.

    Raises
    ------
    WrongUse
        There is no key or a wrong one, or a parameter holds credentials.
    """
    use_key(CLIENT_KEY)
    knock()
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    for item in content["deployments"]:
        refuse_credentials(item["parameters"].get("archive"))
    for pool in {item["work_pool"]["name"]: None for item in content["deployments"]}:
        _have_pool(pool)
    for item in content["deployments"]:
        _have_queue(item["work_pool"]["name"], item["work_pool"]["work_queue_name"])
    return [_register(item) for item in content["deployments"]]


def _have_pool(name: str) -> None:
    """Makes a pool of processes where there is none of the name."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.actions import WorkPoolCreate
    from prefect.exceptions import ObjectNotFound
    from prefect.workers.process import ProcessWorker

    with get_client(sync_client=True) as client:
        try:
            client.read_work_pool(name)
        except ObjectNotFound:
            template = ProcessWorker.get_default_base_job_template()
            client.create_work_pool(WorkPoolCreate(name=name, type=ProcessWorker.type, base_job_template=template))


def _have_queue(pool: str, name: str) -> None:
    """Makes a queue that gives out one run at a time; one that is there is changed."""
    from prefect.client.orchestration import get_client
    from prefect.exceptions import ObjectNotFound

    with get_client(sync_client=True) as client:
        try:
            queue = client.read_work_queue_by_name(name, work_pool_name=pool)
        except ObjectNotFound:
            client.create_work_queue(name, work_pool_name=pool, concurrency_limit=ONE_AT_A_TIME)
        else:
            client.update_work_queue(queue.id, concurrency_limit=ONE_AT_A_TIME)


def _register(item: dict[str, Any]) -> str:
    from prefect.client.schemas.schedules import CronSchedule
    from prefect.deployments.runner import RunnerDeployment
    from prefect.types.entrypoint import EntrypointType

    module, _, name = item["entrypoint"].rpartition(".")
    deployment = getattr(import_module(module), name).to_deployment(
        name=item["name"],
        description=item["description"],
        tags=item["tags"],
        parameters=item["parameters"],
        concurrency_limit=item["concurrency_limit"],
        schedules=[CronSchedule(cron=s["cron"], timezone=s["timezone"]) for s in item["schedules"]],
        work_pool_name=item["work_pool"]["name"],
        work_queue_name=item["work_pool"]["work_queue_name"],
        # by its module: by its file Prefect would put the file's folder first on sys.path, where our operator.py hides
        # Python's own, and no process that a flow starts (a station's watchdog) would come up
        entrypoint_type=EntrypointType.MODULE_PATH,
        job_variables={"working_dir": str(_working_folder())},  # where recipes and stations of deploy/ are found
    )
    if not isinstance(deployment, RunnerDeployment):
        raise TypeError(NOT_HERE)
    deployment.apply(work_pool_name=item["work_pool"]["name"])
    return f"{deployment.flow_name}/{deployment.name}"


def _working_folder() -> Path:
    """The folder that flows run in: the source tree, or for an installed product, which has none, the present folder."""
    return TREE if (TREE / "deploy" / "prefect.yaml").is_file() else Path.cwd()


if __name__ == "__main__":
    try:
        sys.stdout.write("\n".join(register(Path(sys.argv[1]))) + "\n")
    except TumblelineError as problem:
        sys.stderr.write(f"tumbleline: {problem}\n")
        sys.exit(problem.exit_status)
