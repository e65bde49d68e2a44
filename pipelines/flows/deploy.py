"""Register the deployments of a ``prefect.yaml`` with their pools and queues: ``prefect deploy --all``, and the steps it omits.

A work queue is a station (or another resource with one run at a time): its limit of one run is set here, as ``prefect.yaml``
has no key for it. The limit of a deployment does not separate two deployments of one station. The policy of a deployment
(:mod:`pipelines.orchestrator.policy`) becomes its tags; an automation closes runs whose heartbeat stopped.

The command of Prefect 3.8 ends with error 422 with FastAPI 0.151 and later: after each deployment it requests the workers of
the pool with null for two numbers, and FastAPI now reads null as a value and not as a missing one.
"""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from pipelines.orchestrator.archive_address import refuse_credentials
from pipelines.orchestrator.policy import policy_of
from pipelines.orchestrator.settings import CLIENT_KEY, check_server, use_key
from schemas.errors import TumblelineError

NOT_HERE = "deployments are registered from code that is not asynchronous"
TREE = Path(__file__).resolve().parents[2]
ONE_AT_A_TIME = 1
PATIENCE_S = 60.0


def register(path: Path) -> list[str]:
    """Register the deployments of a file with the server of PREFECT_API_URL; return their names.

    Raises WrongUse: the key is missing or wrong, a parameter has credentials, or a policy has an unknown key or value.
    """
    use_key(CLIENT_KEY)
    check_server(PATIENCE_S)
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    for item in content["deployments"]:
        refuse_credentials(item["parameters"].get("archive"))
        policy_of(item["name"], item.get("policy"))
    for item in content["deployments"]:
        _have_queue(item["work_pool"]["name"], item["work_pool"]["work_queue_name"])
    names = [_register(item) for item in content["deployments"]]
    from pipelines.orchestrator.dead_runs import have_automation

    have_automation()
    return names


def _have_queue(pool: str, name: str) -> None:
    """Make a pool of processes unless it exists, and a queue in it with one run at a time; an existing queue is changed."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.actions import WorkPoolCreate
    from prefect.exceptions import ObjectNotFound
    from prefect.workers.process import ProcessWorker

    with get_client(sync_client=True) as client:
        try:
            client.read_work_pool(pool)
        except ObjectNotFound:
            template = ProcessWorker.get_default_base_job_template()
            client.create_work_pool(WorkPoolCreate(name=pool, type=ProcessWorker.type, base_job_template=template))
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
        tags=[*item["tags"], *policy_of(item["name"], item.get("policy")).tags()],
        parameters=item["parameters"],
        concurrency_limit=item["concurrency_limit"],
        schedules=[CronSchedule(cron=s["cron"], timezone=s["timezone"]) for s in item["schedules"]],
        work_pool_name=item["work_pool"]["name"],
        work_queue_name=item["work_pool"]["work_queue_name"],
        # by module: for a file Prefect would put its folder first on sys.path, where operator.py of this package hides
        # Python's own, and processes of a flow (a station's watchdog) could not start
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
