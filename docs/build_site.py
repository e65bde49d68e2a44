"""``python -m docs.build_site``: the documents and the references of packages as a site that is searched without a network.

Pages link to each other, to pages of ``deploy/`` and to files of the source, so the site is built from a copy of these in which
every relative link holds. ``mkdocs build --strict`` then fails for a link or an anchor that leads nowhere.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
CONFIGURATION = ROOT / "docs" / "site" / "mkdocs.yaml"
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "deploy/*.md", "docs/**/*.md", "benchmarks/README.md")
PICTURES = ("docs/pictures/*.svg", "docs/pictures/*.png")
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
HEADINGS = {"tutorial": "Tutorial", "how-to": "How-to", "explanation": "Explanation", "reference": "Reference"}
NEEDED = ("mkdocs", "material", "mkdocstrings")
REFERENCES = {
    "tumbleline": "The package for Python: read, fit, diagnose, improve, archives. Written from the docstrings.",
    "inertial": "The science: numpy and scipy only, no files, no clock. Written from the docstrings.",
}
SHIM = "iframe-worker.js"


def stage(folder: Path) -> list[Path]:
    """Copy pages, pictures and the files that pages link to; write the pages of the reference; all pages that were made."""
    pages = [path for pattern in PAGES for path in sorted(ROOT.glob(pattern))]
    for path in (*pages, *(picture for pattern in PICTURES for picture in ROOT.glob(pattern))):
        _copy(path, folder)
    (folder / "assets").mkdir()
    shutil.copy(CONFIGURATION.parent / SHIM, folder / "assets" / SHIM)
    for path in pages:
        target = folder / path.relative_to(ROOT)
        target.write_text(_linked(path, folder), encoding="utf-8")
    return [folder / path.relative_to(ROOT) for path in pages] + _reference(folder)


def _linked(page: Path, folder: Path) -> str:
    """Text of a page; linked files of the source are copied, and a link to a folder becomes plain text."""

    def replaced(match: re.Match[str]) -> str:
        before, address, after = match.groups()
        target = (page.parent / address.partition("#")[0]).resolve()
        if "://" in address or address.startswith(("#", "mailto:")) or not target.is_relative_to(ROOT):
            return match[0]
        if target.is_dir():
            return before.strip("![]()")
        if target.is_file() and not (folder / target.relative_to(ROOT)).exists():
            _copy(target, folder)
        return f"{before}{address}{after}"

    return LINK.sub(replaced, page.read_text(encoding="utf-8"))


def modules(package: str) -> list[str]:
    """Every public module of a package, by its name."""
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in sorted((ROOT / package).rglob("*.py"))]
    plain = [name.removesuffix(".__init__") for name in names]
    return [name for name in plain if not any(part.startswith("_") for part in name.split("."))]


def _reference(folder: Path) -> list[Path]:
    """One page for each module, and their list."""
    made: list[Path] = []
    for package, what in REFERENCES.items():
        place = folder / "docs" / "reference" / package
        place.mkdir(parents=True, exist_ok=True)
        for name in modules(package):
            path = place / f"{name}.md"
            path.write_text(f"# {name}\n\n::: {name}\n", encoding="utf-8")
            made.append(path)
        lines = [f"- [{name}]({name}.md)" for name in modules(package)]
        head = f"# Reference of {package}\n\n{what}\n\n"
        (place / "index.md").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
        made.append(place / "index.md")
    return made


def navigation(folder: Path) -> list[dict[str, object]]:
    """The parts of the site: the kinds of documents, the decisions, deployment, and the references of the packages."""
    parts: list[dict[str, object]] = [{"Start": ["README.md", "docs/README.md", "CHANGELOG.md", "CONTRIBUTING.md"]}]
    for name, heading in HEADINGS.items():
        parts.append({heading: _names(folder, f"docs/{name}")})
    parts.append({"Decisions": _names(folder, "docs/decisions")})
    parts.append({"Deployment": _names(folder, "deploy")})
    parts.append({"Benchmarks": ["benchmarks/README.md"]})
    parts += [{f"Reference of {name}": _names(folder, f"docs/reference/{name}")} for name in REFERENCES]
    return parts


def _names(folder: Path, place: str) -> list[str]:
    paths = sorted((folder / place).glob("*.md"), key=lambda path: (path.stem not in {"README", "index"}, path.stem))
    return [str(path.relative_to(folder)) for path in paths]


def build(target: Path) -> int:
    """Build the site into a folder; the exit status of mkdocs."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        sys.stderr.write(
            f"docs: {', '.join(missing)} not installed, the extra 'docs' is needed; run pip install 'tumbleline[docs]'\n"
        )
        return 2
    with tempfile.TemporaryDirectory() as name:
        staged = Path(name) / "pages"
        stage(staged)
        content = yaml.safe_load(CONFIGURATION.read_text(encoding="utf-8"))
        content |= {"docs_dir": str(staged), "site_dir": str(target.resolve()), "nav": navigation(staged)}
        content["plugins"][-1]["mkdocstrings"]["handlers"]["python"]["paths"] = [str(ROOT)]
        file = Path(name) / "mkdocs.yaml"
        file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--clean",
            "--config-file",
            str(file),
        ]
        environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        return subprocess.run(command, env=environment, check=False).returncode  # noqa: S603 - our own interpreter


def _copy(path: Path, folder: Path) -> None:
    place = folder / path.relative_to(ROOT)
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, place)


def main() -> int:
    """Build with the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m docs.build_site", description="The documents as a site.")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "site", help="Folder of the site.")
    given = parser.parse_args()
    status = build(given.out)
    if status == 0:
        sys.stdout.write(f"{given.out / 'index.html'}\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
