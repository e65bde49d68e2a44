"""What commands print with ``--json`` is what the types of the documents say; other cases are held by ``document_of``."""

import re
import shutil
from pathlib import Path

import pytest
from in_process import given
from pydantic import TypeAdapter
from root_process import ROOT

from deploy.release import unpack
from docs.documents_page import documents, head_of
from pipelines import cli
from pipelines.chain import certify as certifying
from pipelines.cli import COMMANDS

KEPT = ROOT / "tests" / "archives" / "v1.tar.xz"
BY_HEAD = {head_of(kind): kind for kind in documents()}
CASES = {
    "show RUN --json": ["show"],
    "show RUN TABLE --json": ["show", "latest", "coefficients"],
    "verify --json": ["verify"],
    "rerun --check --json": ["rerun", "latest", "--check"],
    "archive diff --json": ["archive", "diff", "latest", "latest"],
    "release whatif --json": ["release", "whatif", "{folder}/model.toml"],
    "station monitor --json": ["station", "monitor"],
    "show RUN --report --json": ["show", "latest", "--report"],
    "release MODEL --json": [
        "release", "{folder}/model.toml", "--since", "2026-01-01", "--force", "--reason", "a test",
    ],
    "release --json": ["release"],
    "certificate list --json": ["certificate", "list"],
    "station profiles --json": ["station", "profiles"],
    "station frames --json": ["station", "frames", str(ROOT / "tests" / "data" / "frames" / "mbpoll-tcpdump.pcap")],
    "archive clean --json": ["archive", "clean", "--dry-run"],
    "archive key --json": ["archive", "key", "--output", "{folder}/key.pem"],
    "archive compact --json": ["archive", "compact"],
    "archive backup --json": ["archive", "backup", "{folder}/copy"],
}  # fmt: skip
WITHOUT_ARCHIVE = {"station frames", "archive key", "station profiles"}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A kept archive whose units are certified, and a model file."""
    folder = tmp_path_factory.mktemp("kept")
    unpack(KEPT, folder / "archive")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(certifying, "refuse_unstated", lambda run: None)  # certified by the version that made the archive
        status, out, err = given("certificate", "issue", "latest", "--json", "--archive", folder / "archive")
    assert status == 0, err
    validate("certificate issue --json", out)
    model = '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment"]\n'
    (folder / "model.toml").write_text(model, encoding="utf-8")
    return folder


def validate(head: str, text: str) -> None:
    """Refuse a document with a value of another type, or a key that is missing or that the type does not have."""
    TypeAdapter(BY_HEAD[head]).validate_json(text, strict=True, extra="forbid")


@pytest.mark.parametrize("head", CASES)
def test_a_command_prints_the_document_of_its_type(head: str, kept: Path, tmp_path: Path) -> None:
    shutil.copytree(kept, tmp_path / "own")
    words = [word.format(folder=tmp_path / "own") for word in CASES[head]]
    place = [] if head.removesuffix(" --json") in WITHOUT_ARCHIVE else ["--archive", tmp_path / "own" / "archive"]
    status, out, err = given(*words, "--json", *place)
    assert status in (0, 1), err
    validate(head, out)


def test_every_typed_document_is_asked_for_by_a_test_and_every_command_that_prints_one_has_a_type() -> None:
    tests = [path for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]
    texts = [text for path in tests if re.search("document_of|--json", text := path.read_text(encoding="utf-8"))]
    for head in BY_HEAD.keys() - CASES.keys():
        words = re.findall(r"[a-z-]+", re.split(r" (?=[^a-z])", head)[0])
        asked = re.compile(", ".join(f'"{word}"' for word in words))
        options = {*re.findall(r"--[a-z-]+", head)} - {"--json"}
        assert any(asked.search(text) and all(option in text for option in options) for text in texts), head
    printing = {
        path.stem.rstrip("_")
        for path in Path(cli.__file__).parent.glob("*.py")
        if "JsonOption" in path.read_text(encoding="utf-8")
    }
    of_a_format = {"export"}  # its --json is the format json: test_export_formats.py
    typed = {head.split()[0] for head in BY_HEAD}
    assert typed <= set(COMMANDS)
    assert (printing & set(COMMANDS)) - of_a_format == typed & printing
