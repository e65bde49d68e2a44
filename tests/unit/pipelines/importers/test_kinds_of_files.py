"""Inspection of files that hold no samples: points of a sweep, dwells, angles alone; each names the command that reads it."""

import shlex
from pathlib import Path

import numpy as np
from in_process import document_of

from inertial.frames import force_from_angles

UNCERTAIN = ",magnitude_uncertainty_percent,phase_uncertainty_deg"


def points(folder: Path, head: str) -> Path:
    """A table of a second-order response of 5 kHz at twenty frequencies."""
    frequency = 10.0 * 1.3 ** np.arange(20.0)
    value = 1.0 / (1.0 - (frequency / 5e3) ** 2 + 0.01j * frequency / 5e3)
    columns = [frequency, np.abs(value), np.degrees(np.angle(value)), np.full(20, 0.5), np.full(20, 0.3)]
    path = folder / "points.csv"
    np.savetxt(path, np.column_stack(columns[: head.count(",") + 1]), "%.6f", ",", header=head, comments="")
    return path


def test_points_of_a_sweep_are_no_record_of_samples_their_command_imports_them_and_says_what_they_lack(
    tmp_path: Path,
) -> None:
    document = document_of("inspect", points(tmp_path, "frequency_hz,magnitude,phase_deg"), status=1)
    assert "no magnitude uncertainty and no phase uncertainty, by which a model is judged" in document["open"][0]
    assert "--procedure sweep" in document["command"]
    path = points(tmp_path, f"frequency_hz,magnitude,phase_deg{UNCERTAIN}")
    document = document_of("inspect", path, status=0)
    meanings = [column["meaning"] for column in document["columns"]]
    assert meanings == ["frequency", "magnitude", "phase", "magnitude uncertainty", "phase uncertainty"]
    assert document["remarks"] == ["a transfer function: 20 points, a frequency each"]
    assert (document["rate_hz"], document["time_unit"], document["open"]) == (None, "", [])
    words = shlex.split(document["command"])
    assert words[:2] == ["tumbleline", "import"]
    made = document_of(*words[1:], "--archive", tmp_path / "archive", status=0)
    assert (made["points"], made["adequate"]) == (20, True)


def test_means_in_poses_are_dwells_and_angles_alone_are_poses_of_a_recipe(tmp_path: Path) -> None:
    outer, inner = 30.0 * np.arange(12.0), 45.0 * (np.arange(12.0) % 8.0)
    angles = np.column_stack([outer, inner])
    rows = np.column_stack([angles, force_from_angles(*np.radians([outer, inner]))])
    alone, means = tmp_path / "poses.csv", tmp_path / "means.csv"
    np.savetxt(alone, angles, "%.1f", ",", header="outer_deg,inner_deg", comments="")
    labelled = [f"p{k}," + ",".join(f"{value:.6f}" for value in row) for k, row in enumerate(rows)]
    means.write_text("\n".join(["pose,outer_deg,inner_deg,x,y,z", *labelled]) + "\n", encoding="utf-8")
    document = document_of("inspect", means, status=0)
    assert "a row is a dwell: the mean output in one pose, without its samples" in document["remarks"]
    assert "--set rows=dwells" in document["command"]
    document = document_of("inspect", alone, status=1)
    assert document["command"] == "tumbleline plan RECIPE"
    assert document["open"][0].startswith("the output in each pose: angles of the table alone are no measurement")
    np.savetxt(means, rows, "%.6f", ",", header="outer_deg,inner_deg,one,two,three", comments="")
    assert "tumbleline import" in document_of("inspect", means)["command"]  # numbers beside the angles may be outputs
