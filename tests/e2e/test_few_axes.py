"""A recording of a device with one axis: its unit, and what is needed beside it for a fit."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from in_process import document_of, refused, text_of


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve rests of 4 s at 50 Hz between turns, in mg, with the force along the axis."""
    rng, parts = np.random.default_rng(3), list[np.ndarray]()
    for angle in np.arange(0.0, 360.0, 30.0):
        parts += [np.full(200, angle), np.linspace(angle, angle + 30.0, 25)]
    force, moving = np.sin(np.radians(np.concatenate(parts))), np.tile(np.repeat([0.2, 30.0], [200, 25]), 12)
    output = 1003.0 * force + 12.0 + moving * rng.normal(size=force.size)
    path = tmp_path_factory.mktemp("given") / "one.csv"
    table = pd.DataFrame({"time_s": np.arange(force.size) / 50.0, "acc [mg]": output, "along": force})
    table.to_csv(path, index=False)
    return path


def test_it_has_the_unit_of_its_heading_and_is_fitted_where_the_force_along_it_is_known(
    recording: Path, tmp_path: Path
) -> None:
    assert "--unit-of output=mg" in text_of("inspect", recording, status=None)
    given = ("import", recording, "--units", "S1", "--set", "axes=x", "--archive", tmp_path)
    known = document_of(*given, "--map", "time=time_s,x=acc [mg],force_x=along")["run"]
    fitted = document_of("fit", known, "--archive", tmp_path)
    assert fitted["adequate"] is True
    assert document_of("diagnose", known, "--archive", tmp_path)["error"] == fitted["error"]


def test_without_a_reference_fit_and_diagnosis_say_what_is_needed(recording: Path, tmp_path: Path) -> None:
    given = ("import", recording, "--units", "S1", "--archive", tmp_path)
    alone = document_of(*given, "--set", "axes=x", "--map", "time=time_s,x=acc [mg]")["run"]
    messages = {refused(command, alone, "--archive", tmp_path) for command in ("fit", "diagnose")}
    assert len(messages) == 1
    assert "--map tilt=… or force_x=…" in messages.pop()
    two = ("--set", "axes=x,y", "--map", "time=time_s,x=acc [mg],y=along,force_x=along", "--unit-of", "output=mg")
    assert "force_x without force_y, force_z" in refused(*given, *two)
