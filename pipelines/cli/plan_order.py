"""``tumbleline plan order``: soaks and poses of a recipe with ``[stop]`` in the order with which its units are known first."""

from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from pipelines.cli import options
from pipelines.cli.documents.station import OrderDocument
from pipelines.cli.options import argument, option
from pipelines.cli.printing import give, is_standard_output, print_text, say
from schemas.errors import RecipeInvalid, WrongUse

NOT_REACHED = "not reached"
ENDING = "-ordered"


def order(
    recipe: Annotated[str, argument("RECIPE", "Recipe with a table 'stop'.")],
    output: Annotated[
        list[Path] | None,
        option("--output -o FILE", "The new recipe (.toml; - prints it; NAME-ordered.toml by default)."),
    ] = None,
    station: options.StationOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Write a recipe with its soaks and poses in the order with which its units are known first.

    Nothing is added or left out. The minutes are those until the uncertainties of its table 'stop' are reached, expected with the
    noise of the device's preset; limits and visible effects are not part of them, and may let the lot go on for longer.
    """
    from inertial.design import local_names, split
    from pipelines.archive import files
    from pipelines.jobs.recipe_text import limits_from, recipe_text
    from pipelines.jobs.recipes import folder_of, load_limits, load_recipe
    from pipelines.jobs.terms import asked_of_noise, refuse_unusable_stop
    from pipelines.planning.context import noise_of, plan_context
    from pipelines.planning.soak_order import ordered
    from schemas.station import load_station
    from schemas.units import MICRO

    file = options.outputs(output, {"recipe": (".toml", "-")}, "plan order").get("recipe")
    printed = is_standard_output(file, "plan order", as_json=as_json)
    config, base, home = load_station(station), load_recipe(recipe), folder_of(recipe)
    if base.stop is None:
        raise RecipeInvalid(f"recipe {base.name}: no table [stop], which says what is to be known; add one", key="stop")
    limits = load_limits(base, home)
    refuse_unusable_stop(base, config, limits)
    allowed = asked_of_noise(base, config, limits)
    names = [effect for effect, _ in local_names(split(base.effects)[0], 0)]
    required = np.array([[allowed.get(effect, np.inf) / MICRO for effect in names]] * base.sensor_axes)
    context = plan_context(base, config, noise_of(base, base.device, None, None))
    found = ordered(context, required)
    name = f"{base.name.removesuffix(ENDING)}{ENDING}"
    target = file or Path(f"{name}.toml")
    if target.exists() and Path(recipe).exists() and target.samefile(recipe):
        raise WrongUse(f"plan order: {target} is the given recipe, a file of its own is needed; name one with --output")
    new = found.recipe.model_copy(update={"name": name, "limits": limits_from(base.limits, home, target.parent)})
    text = recipe_text(new, [f"Written by 'tumbleline plan order' for station {config.name}."])
    if not printed:
        files.publish(target, text.encode(), "plan order", files.ELSEWHERE)
    document: OrderDocument = {
        "recipe": new.name,
        "file": str(target),
        "temperatures_C": new.temperatures_C,
        "minutes": round(plan_context(found.recipe, config, context.noise).minutes, 1),
        "given_minutes": round(context.minutes, 1),
        "known_minutes": found.until and round(found.until, 1),
        "given_known_minutes": found.before and round(found.before, 1),
    }
    give(document, partial(_print, text=text if printed else ""), as_json=as_json)


def _print(document: OrderDocument, text: str) -> None:
    if text:
        print_text(text)
        return
    heat = ", ".join(f"{t:g}" for t in document["temperatures_C"])
    until, before = (
        NOT_REACHED if known is None else "only at its end" if known >= total else f"{known:.0f} min"
        for known, total in (
            (document["known_minutes"], document["minutes"]),
            (document["given_known_minutes"], document["given_minutes"]),
        )
    )
    say(
        f"{document['recipe']}: soaks at {heat} °C, {document['minutes']:.0f} min (given: {document['given_minutes']:.0f} min)"
    )
    say(f"uncertainties reached after: {until} (given: {before}), limits and visible effects left out")
    say(f"Recipe file: {document['file']}")
