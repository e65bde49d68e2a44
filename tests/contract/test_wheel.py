"""The wheel holds what the tree holds, and the product runs from it where no tree is."""

import io
import json
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from test_packaging import ROOT, SHIPPED, tracked

from deploy.release import build

SHARE = "share/tumbleline/"
OF_DEPLOYMENT = ("recipes", "stations", "systemd", "prefect.yaml")
SAMPLES = (*(f"deploy/{name}" for name in OF_DEPLOYMENT), "requirements-run.lock", "requirements-all.lock")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Wheel and source distribution, built without a network."""
    return build(tmp_path_factory.mktemp("built"))


@pytest.fixture(scope="module")
def unpacked(built: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(folder)
    return folder


def own_environment(**more: str) -> dict[str, str]:
    """This environment without what would lead a process to the source tree."""
    leading = ("PYTHON", "TUMBLELINE_", "PREFECT_", "VIRTUAL_ENV")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(leading)}
    return {**kept, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **more}


@pytest.mark.slow
def test_the_wheel_holds_every_tracked_file_samples_and_lock_and_says_what_was_tested(unpacked: Path) -> None:
    needed = {str(path.relative_to(ROOT)) for path in tracked(*SHIPPED)}
    files = [path for top in SHIPPED for path in (unpacked / top).rglob("*") if path.is_file()]
    held = {str(path.relative_to(unpacked)) for path in files}
    assert needed - held == set()
    assert {name for name in held if not name.endswith(".pyc")} - needed == set()
    (share,) = unpacked.glob(f"*.data/data/{SHARE}")  # the samples of the deployment and the lock
    samples = {str(path.relative_to(ROOT)): path.read_bytes() for path in tracked(*SAMPLES)}
    assert len(samples) > 15
    shared = {str(path.relative_to(share)): path.read_bytes() for path in share.rglob("*") if path.is_file()}
    assert {name for name, content in samples.items() if shared.get(name) != content} == set()
    (path,) = unpacked.glob("*.dist-info/METADATA")
    text = path.read_text(encoding="utf-8")
    versions = [line for line in text.splitlines() if "Programming Language :: Python :: 3." in line]
    assert versions == [f"Classifier: Programming Language :: Python :: 3.{minor}" for minor in (11, 12, 13, 14)]
    assert "\nLicense-Expression: Apache-2.0\n" in text


@pytest.mark.slow
def test_the_source_distribution_holds_what_the_wheel_was_built_from(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as source:
        held = {name.partition("/")[2] for name in source.getnames()}
    files = tracked(*SHIPPED, *SAMPLES, "pyproject.toml", "LICENSE", "README.md")
    needed = {str(path.relative_to(ROOT)) for path in files}
    assert needed - held == set()
    assert not [name for name in held if name.startswith((".venv", "tests", "archive/"))]


@pytest.mark.slow
def test_the_product_runs_from_the_wheel_in_an_empty_folder(built: tuple[Path, Path], tmp_path: Path) -> None:
    """The libraries are those of this environment, by path: its own installation of the product is not reached that way."""
    home, empty = tmp_path / "venv", tmp_path / "empty"
    empty.mkdir()
    venv.create(home, with_pip=False, symlinks=True)
    python = home / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, built[0]], check=True, env=own_environment(PIP_DISABLE_PIP_VERSION_CHECK="1"))
    (site,) = home.glob("lib/python*/site-packages")
    libraries = next(p for p in sys.path if p.endswith("site-packages"))
    (site / "libraries.pth").write_text(libraries + "\n", encoding="utf-8")
    environment = own_environment(XDG_STATE_HOME=str(tmp_path / "state"), XDG_CONFIG_HOME=str(tmp_path / "config"))

    def run(*words: str) -> str:
        done = subprocess.run(words, cwd=empty, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), (words, done.stderr)
        assert "Traceback" not in done.stderr
        return done.stdout

    where = (
        "import inertial as i, pipelines as p, schemas as s, stations as t; print(*(m.__file__ for m in (i, p, s, t)))"
    )
    places = run(str(python), "-c", where).split()
    assert all(Path(place).is_relative_to(site) for place in places)
    product = str(home / "bin" / "tumbleline")
    samples = home / "share" / "tumbleline" / "deploy"
    assert "investigate" in run(product, "--help")
    assert json.loads(run(product, "plan", "production", "--json"))
    assert "dwells.parquet" in run(product, "demo", "--by-hand", "--seed", "3")
    assert sorted(p.suffix for p in (empty / "demo").iterdir()) == [".parquet"] * 4
    line = run(product, "run", str(samples / "recipes" / "line-six.toml"), "--units", "A1", "--direct", "--json")
    document = json.load(io.StringIO(line))
    assert document["units"][0]["outcome"] in {"pass", "fail"}
    assert (empty / document["report"]).stat().st_size > 10000
    checked = json.loads(run(product, "doctor", "--json"))
    assert checked["samples"] == str(samples)
