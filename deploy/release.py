"""``python -m deploy.release [FOLDER]``: wheel, source distribution, bill of materials and hashes of a release.

The wheel is built from the source distribution, in a separate folder: a file that the source distribution lacks
is missing in the wheel, and files of an earlier build in ``build/`` do not get in. Nothing is fetched.
"""

import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from deploy.sbom import LOCK, ROOT, bill, project_of, release_time

BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"
SUMS = "SHA256SUMS"


def build(folder: Path, root: Path = ROOT) -> tuple[Path, Path]:
    """Wheel and source distribution of a tree, written into a folder.

    root : the tree; it is copied, and stays as it is
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="tumbleline-release-") as temporary:
        copy = Path(temporary) / "tree"
        shutil.copytree(root, copy, ignore=lambda folder, names: _no_source(Path(folder) == root, names))
        source = folder / _run(copy, "build_sdist", folder)
        unpack(source, Path(temporary))
        wheel = folder / _run(Path(temporary) / source.name.removesuffix(".tar.gz"), "build_wheel", folder)
    return wheel, source


def unpack(source: Path, folder: Path) -> None:
    """Unpack a tar file that this project has written.

    The argument ``filter`` came with Python 3.11.4, and without a filter 3.12 and 3.13 warn; the attribute is read where filters
    are known.
    """
    with tarfile.open(source) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)
        archive.extractall(folder)  # noqa: S202 - of our own


def release(folder: Path) -> list[Path]:
    """Every file of a release, written into a folder that holds nothing else afterwards."""
    if folder.is_dir():
        shutil.rmtree(folder)
    wheel, source = build(folder)
    locks = [folder / name for name in (LOCK.name, "requirements-all.lock")]
    for lock in locks:
        shutil.copyfile(ROOT / lock.name, lock)
    project = project_of(ROOT)
    sums = {path.name: _sha256(path) for path in (wheel, source, *locks)}
    bom = folder / f"{project['name']}-{project['version']}.cdx.json"
    content = bill(LOCK.read_text(encoding="utf-8"), project, release_time(), sums)
    bom.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    sums[bom.name] = _sha256(bom)
    listed = folder / SUMS
    listed.write_text("".join(f"{value}  {name}\n" for name, value in sums.items()), encoding="utf-8")
    return [wheel, source, *locks, bom, listed]


def _run(tree: Path, hook: str, folder: Path) -> str:
    """The name of the file that a hook of the build backend makes from a tree (PEP 517)."""
    command = [sys.executable, "-c", BUILD, hook, str(folder.resolve())]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)  # noqa: S603 - our own words
    if done.returncode:
        raise RuntimeError(f"{hook} in {tree}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout.strip().splitlines()[-1]


def _no_source(top: bool, names: list[str]) -> set[str]:  # noqa: FBT001 - called once
    """Names of a folder that belong to no release: environments, caches, archives, and what was built before."""
    hidden = {name for name in names if name.startswith(".") or name == "__pycache__" or name.endswith(".egg-info")}
    return hidden | ({"build", "dist", "archive", "tests", "benchmarks"} & set(names) if top else set())


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    for written in release(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist"):
        sys.stdout.write(f"{written}\n")
