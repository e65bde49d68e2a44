"""The multi-position test: static dwells over poses and temperatures, reduced and fitted by the stages of the chain."""

from typing import Any, Literal

from pipelines.procedures.base import Part, Procedure
from pipelines.procedures.recorded import ProcedureStep
from schemas.recipe import Recipe


class MultiPositionPart(Part):
    """Poses, temperatures, dwells and the model are keys of the recipe itself."""

    kind: Literal["multi_position"]


class MultiPosition(Procedure):
    """Static dwells over poses and temperatures."""

    title = "Multi-position test"
    order = 10
    states = "bias, scale, misalignment, nonlinearity and their temperature coefficients, by the recipe's model"
    source = "IEEE Std 1293, multi-position tumble test; ISO 16063-16 for the reference"
    part = MultiPositionPart

    def steps(self, part: Any, recipe: Recipe) -> list[ProcedureStep]:
        """Per temperature the poses of the fit, and those for verification after them, or spread evenly among them."""
        steps: list[ProcedureStep] = []
        for soak, temperature in enumerate(recipe.temperatures_C):
            poses, waits, settled = recipe.poses_at(soak), recipe.waits_at(soak), recipe.settles_at(soak)
            fit = [
                ProcedureStep(pose.name, pose, temperature, "dwell", wait_s=wait, off_s=off, soak=soak, settled=settled)
                for pose, wait, off in zip(poses, waits, recipe.off_at(soak), strict=True)
            ]
            checks = [
                ProcedureStep(pose.name, pose, temperature, "verification", soak=soak, settled=settled)
                for pose in recipe.verification_at(soak)
            ]
            every = [*fit, *checks]
            if recipe.verification_order == "interleaved":  # those for verification spread among the others
                at = [(k + 0.5) / len(group) for group in (fit, checks) for k in range(len(group))]
                every = [every[k] for k in sorted(range(len(every)), key=lambda k: (at[k], k))]
            steps += every
        return steps


PROCEDURE = MultiPosition()
