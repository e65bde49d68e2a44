"""What a capture of procedures leaves, as the stage of the procedures takes it."""

from small_station import MemorySink

from pipelines.procedures.recorded import Device, ProcedureRecord, nominal_device, procedure_record
from pipelines.schedule.steps import steps
from schemas.recipe import Recipe


def procedure_records(recipe: Recipe, sink: MemorySink) -> tuple[list[ProcedureRecord], Device]:
    """Every record of a procedure in order of measurement, and the device by its readings."""
    readings = sink.all(1)
    records = [
        procedure_record(k, step.order, [sink.records[k][0]], readings[readings["record"] == k])
        for k, step in enumerate(steps(recipe))
        if step.order is not None
    ]
    return records, nominal_device(readings)
