"""The first picture of a diagnosis: the residual follows the model's curve over the quantity of the effect, and not after it."""

import re
import sys
from functools import cache

import numpy as np
import pytest
from root_process import ROOT

from pipelines.diagnosis.diagnose import Examination, examination
from pipelines.report.effect_view import EffectView, effect_chart, effect_views

sys.path.insert(0, str(ROOT / "benchmarks" / "worlds"))

from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")
MODEL = ("bias", "scale", "misalignment")


@cache
def judged(hidden: str, more: tuple[str, ...] = ()) -> Examination:
    effects = ((hidden, 3.0),) if hidden else ()
    return examination(make(World(units=3, soaks=(25.0,), repeats=2, hidden=effects), 41).dwells, None, (*MODEL, *more))


def first_of(hidden: str) -> EffectView:
    made = judged(hidden)
    return effect_views(made.diagnosis, made.sound)[0]


@pytest.mark.parametrize(
    ("hidden", "quantity"),
    [
        ("third_order", r"specific force along [xyz] / g"),
        pytest.param("cross_coupling", r"f[xyz]·f[xyz] / g²|the contribution of .*", marks=pytest.mark.slow),
    ],
)
def test_the_residual_is_seen_against_what_the_effect_depends_on(hidden: str, quantity: str) -> None:
    view = first_of(hidden)
    assert view.effect in next(iter(judged(hidden).document["classes"]))["effects"]
    assert re.fullmatch(quantity, view.quantity)
    x, before, after = view.x[view.shown], view.before[view.shown], view.after[view.shown]
    followed = np.interp(x, *view.line(view.shown))
    assert np.corrcoef(followed, before)[0, 1] > 0.8
    assert abs(np.corrcoef(followed, after)[0, 1]) < 0.3
    chart = effect_chart(view)
    assert [plot.title.split(",")[0] for plot in chart.plots] == ["before", "after"]
    lines = [one for one in chart.plots[0].traces if (one.role, one.style) == ("muted", "line") and one.x.size > 2]
    assert len(lines) == 2  # a curve of each other unit


@pytest.mark.slow
def test_where_nothing_is_missing_the_residual_stands_alone_with_the_noise() -> None:
    view = first_of("")
    assert (view.effect, view.after, len(effect_chart(view).plots)) == ("", None, 1)
    assert 0.5 < np.std(view.before[view.shown]) / view.floor < 2.0


@pytest.mark.slow
def test_an_effect_of_the_model_is_seen_as_what_it_takes_off() -> None:
    made = judged("third_order", ("third_order",))
    view = effect_views(made.diagnosis, made.sound, "third_order")[0]
    assert view.effect == "third_order"
    assert np.nanstd(view.before) > 1.5 * np.nanstd(view.after)


def test_residuals_that_would_be_a_straight_line_get_a_finer_scale() -> None:
    x = np.linspace(-1.0, 1.0, 20)[None]
    small = 0.01 * np.cos(9.0 * x)
    view = EffectView("e", "q", "x", ("U",), 0, x, 100.0 * x, small, 100.0 * x, 0.02)
    assert not view.on_one_scale
    assert view.largest("after") < 0.01 * view.largest("before")
    assert "finer scale" in effect_chart(view).plots[1].title
