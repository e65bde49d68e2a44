"""Whether measurements leave degrees of freedom by which a model can be judged."""

from inertial.errors import NotIdentified
from inertial.estimation.model import Model


def refuse_without_freedom(model: Model) -> None:
    """Refuse to judge a model that has as many coefficients as there are measurements: it fits any data.

    Raises
    ------
    NotIdentified
        No degree of freedom is left.
    """
    if model.at(model.problem.covariance.white_noise()).dof < 1:
        count, series = model.problem.count, model.problem.blocks
        raise NotIdentified(
            f"model: {count // series} dwells a unit leave no degree of freedom to judge the model, more dwells than its "
            "coefficients on an axis are needed; measure more poses or repeats, or judge a smaller model"
        )
