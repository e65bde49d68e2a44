"""An inquiry through an orchestrator that needs no set-up, as runs are; nothing of it is imported before it answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.chain import ORDER
from pipelines.flows.local import reached

if TYPE_CHECKING:
    from pipelines.archive import Archive
    from pipelines.inquiry.play import Table, Terms
    from pipelines.job import Request


def investigate_locally(request: Request, archive: Archive, terms: Terms, table: Table, *, ask: bool) -> dict[str, Any]:
    """The document of the inquiry that the flow makes, on the server named by PREFECT_API_URL or on one of our own."""
    archive.prepare()
    job = request.job(archive)
    name = f"investigate {job.recipe.name} {job.capture_id}"
    with reached(archive):
        from pipelines.flows.calibrate import settle_history
        from pipelines.flows.dead_runs import close_dead_runs
        from pipelines.flows.investigate import investigate, seated
        from pipelines.flows.places import named

        close_dead_runs(name)
        with seated(table), named(archive) as address:
            flow = investigate.with_options(flow_run_name=name)
            found: Any = flow(
                **request.parameters(),
                archive=address,
                effects=list(terms.effects),
                budget_min=terms.budget,
                unseen=terms.unseen,
                ask=ask,
            )
        settle_history(name, len(ORDER))
    return found
