"""Messages of imports that name the place in the file, the number that is known, and the step that helps."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from recordings import FACES, counts, table
from typer.testing import CliRunner

from pipelines.cli import app
from schemas.errors import DataRejected

UP = "xp=+x,xm=-x,yp=+y,ym=-y,zp=+z,zm=-z"
MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--units", "output=LSB", "--unit", "N1")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: str) -> str:
    """What a command prints, or the text of its refusal."""
    result = CliRunner().invoke(app, [*words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        return str(result.exception)
    return result.output


def recording(seed: int = 11) -> pd.DataFrame:
    return table(counts(np.random.default_rng(seed), positions=6))


def damaged(frame: pd.DataFrame, row: int, column: str) -> pd.DataFrame:
    out = frame.astype(object)
    out.loc[row, column] = "nan"
    return out


def write(name: str, frame: pd.DataFrame, *, before: str = "", divider: str = ",") -> int:
    """Write a table behind other lines; the line, as an editor counts, of its first cell without a number."""
    text = before + frame.to_csv(index=False, sep=divider)
    Path(name).write_text(text, encoding="utf-8")
    return next((k for k, line in enumerate(text.split("\n"), 1) if "nan" in line), 0)


@pytest.mark.parametrize("column", ["ay", "t"])
@pytest.mark.parametrize("before", ["", "# logger 7\n# second line\n\n", "Recorded by me\nin the cellar\n"])
def test_a_value_that_is_no_number_is_refused_with_the_line_of_the_file(before: str, column: str) -> None:
    line = write("a.csv", damaged(recording(), 500, column), before=before)
    said = run("import", "a.csv", *MAPPED)
    assert f"row 501 (line {line}), column '{column}'" in said
    assert "(1 such row)" in said


def test_a_comment_between_the_rows_counts_as_a_line() -> None:
    write("a.csv", damaged(recording(), 500, "az"))
    lines = Path("a.csv").read_text(encoding="utf-8").split("\n")
    lines[100:100] = ["# knocked at the table", ""]
    Path("a.csv").write_text("\n".join(lines), encoding="utf-8")
    assert f"(line {next(k for k, line in enumerate(lines, 1) if 'nan' in line)})" in run("import", "a.csv", *MAPPED)


def test_of_joined_files_the_line_is_that_of_the_file_with_the_fault() -> None:
    whole = recording()
    write("a.csv", whole.iloc[:900])
    line = write("b.csv", damaged(whole.iloc[900:].reset_index(drop=True), 40, "ax"), before="# two\n")
    assert f"row 941 (line {line} of b.csv)" in run("import", "a.csv", "b.csv", "--join", "rows", *MAPPED)
    write("c.csv", damaged(whole[["t", "ax"]], 40, "ax"))
    write("d.csv", whole[["t", "ay", "az"]])
    # two files side by side have no line in common
    assert "row 41, column 'ax'" in run("import", "c.csv", "d.csv", "--join", "columns", *MAPPED)


def test_a_line_break_in_a_quoted_field_leaves_the_row_alone() -> None:
    frame = damaged(recording(), 500, "az").assign(note="-")
    frame.loc[3, "note"] = "two\nlines"
    write("a.csv", frame)
    said = run("import", "a.csv", *MAPPED)
    assert "row 501, column 'az'" in said


def test_rows_left_out_are_told_with_the_line() -> None:
    line = write("a.csv", damaged(recording(), 500, "az"), before="# one\n")
    assert f"the first is row 501 (line {line})" in run("import", "a.csv", *MAPPED, "--gaps", "split")


def test_faces_without_a_known_noise_print_no_number_that_is_none() -> None:
    means = FACES @ np.diag([1.01, 0.99, 1.0]) + [0.02, -0.01, 0.03]
    for name, order in (("right", [0, 1, 2, 3, 4, 5]), ("wrong", [0, 1, 3, 4, 5, 2])):
        frame = pd.DataFrame(means[order], columns=["x", "y", "z"]).assign(face=["xp", "xm", "yp", "ym", "zp", "zm"])
        frame.to_csv(f"{name}.csv", index=False)
        said = run(
            "import", f"{name}.csv", "--map", "x=x,y=y,z=z,dwell=face", "--rows", "dwells", "--units", "output=g",
            "--unit", "S1", "--poses", UP, "--local-g", "9.81", "--fit", "faces",
        )  # fmt: skip
        assert "nan" not in said
        assert "lack of fit" in said
        assert not re.search(r"^\s*adequate", said, re.MULTILINE)
        assert ("NOT ADEQUATE" if name == "wrong" else "CANNOT BE JUDGED") in said


def test_an_axis_at_the_end_of_its_range_is_told_as_clipped() -> None:
    frame = table(counts(np.random.default_rng(11), directions=FACES, noise=20.0))
    frame["ax"] = frame["ax"].clip(-15_000, 15_000)
    write("a.csv", frame)
    count = int((frame["ax"].abs() == 15_000).sum())  # two whole dwells, and moments of the moves
    said = run("inspect", "a.csv")
    told = re.search(r"axis x is clipped: (\d+) samples", said)
    assert told, said
    assert 0.9 * count <= int(told[1]) <= count
    assert "axis y is clipped" not in said


def test_one_pose_in_counts_is_not_told_to_fit_a_scale() -> None:
    rng = np.random.default_rng(7)
    time = np.arange(12_000) / 100.0
    output = np.round(rng.normal([0.0, 0.0, 16384.0], 5.0, (time.size, 3)))
    frame = pd.DataFrame(output, columns=["ax", "ay", "az"]).assign(t=time, temp=25.0 + 5.0 * np.sin(time / 20.0))
    frame.to_csv("a.csv", index=False)
    mapped = ("--map", "time=t,x=ax,y=ay,z=az,temperature=temp", "--unit", "P1", "--face", "+z", "--blocks", "10")
    run("import", "a.csv", *mapped, "--units", "output=LSB", "--local-g", "9.81")
    said = run("fit", "latest", "--effects", "bias,bias_temperature")
    assert "add 'scale'" not in said
    assert "divide the outputs" in said
    assert "--units output=g" in said
    # the advice, followed, leads to a fit
    frame[["ax", "ay", "az"]] /= 16384.0
    frame.to_csv("b.csv", index=False)
    run("import", "b.csv", *mapped, "--units", "output=g", "--local-g", "9.81")
    result = CliRunner().invoke(app, ["fit", "latest", "--effects", "bias,bias_temperature"])
    assert not isinstance(result.exception, DataRejected), result.exception
    assert result.exit_code in (0, 1), result.output
