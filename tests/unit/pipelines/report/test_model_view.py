"""The first picture of a unit: what the model takes off the residuals, against what they follow."""

import numpy as np
import pandas as pd
import pytest

from pipelines.archive import Run
from pipelines.report.effect_view import effect_chart
from pipelines.report.model_view import model_view


@pytest.fixture
def unit(run: Run) -> tuple[pd.DataFrame, pd.DataFrame, list[str]]:
    """Dwells, residuals and effects of a unit of a run at two temperatures."""
    dwells, residuals = (table[table["unit"] == "A1"] for table in (run.table("dwells"), run.table("residuals")))
    return dwells[dwells["kind"] == "dwell"], residuals, list(dict.fromkeys(run.table("coefficients")["effect"]))


def test_before_is_what_the_linear_model_leaves_and_after_the_residual_of_the_run(unit) -> None:
    dwells, residuals, effects = unit
    view = model_view("A1", dwells, residuals, effects)
    assert view.effect == "bias_temperature, scale_temperature"
    assert view.quantity == "temperature of the unit / °C"
    own = residuals[residuals["axis"] == view.axis].sort_values("dwell")
    assert np.array_equal(view.after[0], own["residual_ug"])
    assert np.sqrt(np.mean(view.before**2)) > 50.0 * np.sqrt(np.mean(view.after**2))
    x, line = view.line(0)
    assert np.all(np.diff(x) > 0.0)
    assert line[-1] - line[0] > 1000.0  # the bias over temperature of these units, µg
    assert [plot.title.split(",")[0] for plot in effect_chart(view).plots] == ["before", "after"]
    scaled = dwells.assign(**{f"out_{axis}": -3.0 * dwells[f"out_{axis}"] + 7.0 for axis in "xyz"})
    assert np.allclose(
        view.before, -model_view("A1", scaled, residuals, effects).before
    )  # whatever the unit of the output


def test_a_linear_model_and_unknown_forces_have_the_residual_alone(unit) -> None:
    dwells, residuals, effects = unit
    for table, names in ((dwells, ["bias", "scale", "misalignment"]), (dwells.drop(columns="force_x"), effects)):
        view = model_view("A1", table, residuals, names)
        assert view.after is None
        assert np.abs(view.before).max() <= residuals["residual_ug"].abs().max()
        assert len(effect_chart(view).plots) == 1


def test_where_the_model_leaves_more_than_the_linear_fit_its_own_residual_is_drawn(unit) -> None:
    dwells, residuals, effects = unit
    worse = residuals.assign(residual_ug=1e5 + 1e4 * (residuals["axis"] == "y") + residuals["dwell"])
    view = model_view("A1", dwells, worse, effects)
    assert view.after is view.curve is None
    assert view.axis == "y"
    assert np.array_equal(view.before[0], worse[worse["axis"] == "y"].sort_values("dwell")["residual_ug"])
    (plot,) = effect_chart(view).plots
    assert "residual" in [trace.name for trace in plot.traces]
    assert effect_chart(view).title.startswith("Residual against")


def test_residuals_that_follow_the_rate_of_the_temperature_are_drawn_against_it(unit) -> None:
    dwells, residuals, _ = unit
    phase = 2.0 * np.pi * 3.0 * (dwells["time_s"] - dwells["time_s"].min()) / np.ptp(dwells["time_s"])
    swinging = dwells.assign(unit_C=25.0 + 8.0 * np.sin(phase))
    followed = residuals.assign(
        residual_ug=residuals["dwell"].map(dict(zip(dwells["dwell"], 40.0 * np.cos(phase), strict=True)))
    )
    view = model_view("A1", swinging, followed.dropna(subset="residual_ug"), ["bias", "scale", "misalignment"])
    assert view.quantity.startswith("rate of temperature")
    assert abs(np.corrcoef(view.x[0], view.before[0])[0, 1]) > 0.9
