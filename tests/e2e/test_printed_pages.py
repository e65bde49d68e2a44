"""What README and guides show as printed is printed: each block with an output is compared by a test, here or elsewhere."""

import re
import shlex
import shutil
from pathlib import Path

import in_process
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "deploy").glob("*.md"))]
COMPARED = {
    "find-a-missing-effect": "tests/e2e/test_diagnosis_docs.py",
    "add-your-own-effect": "tests/e2e/test_diagnosis_docs.py",
    "from-a-spreadsheet": "tests/e2e/test_pages_by_role.py",
    "trace-a-certificate": "tests/e2e/test_trace_docs.py",
    "export": "tests/e2e/test_export_docs.py",
    "import-your-data": "tests/e2e/test_import_docs.py",
    "correct-a-recording": "tests/e2e/test_correct.py",
    "improve-a-model": "tests/e2e/test_printed_pages.py",
    "README": "tests/e2e/test_printed_pages.py",
    "issue-a-certificate": "tests/e2e/test_printed_pages.py",
    "program-the-device": "tests/faults/test_programming.py",
}
"""Pages with printed outputs, and the test that compares them."""


def outputs(page: Path) -> list[tuple[str, str]]:
    """The commands of the console blocks of a page below which an output stands, with it."""
    examples: list[tuple[str, str]] = []
    for block in re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        for command, printed in re.findall(r"^\$ (tumbleline .*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
            if printed.strip():
                examples.append((command.split("  #")[0].strip(), printed))
    return examples


def test_every_page_that_shows_an_output_is_compared_by_a_test() -> None:
    shown = {page.stem for page in PAGES if outputs(page)}
    assert shown == set(COMPARED)
    for stem, test in COMPARED.items():
        text = (ROOT / test).read_text(encoding="utf-8")
        assert stem in text or f"{stem}.md" in text, (stem, test)


def pattern(printed: str) -> str:
    """A printed text as a pattern: blanks and numbers may differ, ``…`` stands for anything."""
    words = re.escape(" ".join(re.sub(r"[─\s]+", " ", printed).split()))
    return re.sub(r"\d+(?:\\?\.\d+)?(?:e\\?-?\d+)?", r"[\\d.e+-]+", words).replace("…", ".*?")


def given(command: str) -> tuple[int, str, str]:
    """The command line in this process: status, standard output, standard error."""
    return in_process.given(*shlex.split(command)[1:], columns=100)


def compared(command: str, printed: str) -> None:
    status, out, err = given(command)
    assert status in {0, 1}, (command, err)
    text = " ".join(re.sub(r"[─\s]+", " ", out).split())
    assert re.search(pattern(printed), text), (command, text)


def test_a_removed_effect_is_told_as_the_guide_to_improvements_shows(tmp_path: Path, monkeypatch) -> None:
    ((command, printed),) = outputs(ROOT / "docs" / "how-to" / "improve-a-model.md")
    monkeypatch.chdir(tmp_path)
    Path("game").mkdir()
    given("tumbleline extend game/model.toml cross_coupling --effects bias,scale,misalignment")
    compared(command, printed)


@pytest.mark.slow
def test_the_story_of_the_readme_prints_what_it_shows(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    story = text[text.index("## Find the missing effect") : text.index("## On the line")]
    shown = dict(outputs(ROOT / "README.md"))
    for command in re.findall(r"^\$ (tumbleline .*)$", story, re.MULTILINE):
        if command in shown:
            compared(command, shown[command])
        else:
            status, _, err = given(command)
            assert status == 0, (command, err)


@pytest.mark.slow
def test_the_main_job_prints_what_the_readme_shows(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```\n( +fit +verify.*?)```", text, flags=re.DOTALL)
    assert block is not None
    status, out, err = given("tumbleline run")
    assert status == 0, err
    words = " ".join(re.sub(r"[─\s]+", " ", re.sub(r"production-\w+", "RUN", out)).split())
    wanted = pattern(re.sub(r"production-\w+", "RUN", block[1]))
    assert re.search(wanted, words), words
    verdict = re.search(r"^model +(.*)$", block[1], flags=re.MULTILINE)
    assert verdict is not None
    compared("tumbleline diagnose latest", verdict[1])  # the command that the run names says the same


@pytest.mark.slow
def test_a_certificate_is_told_as_its_guide_shows(tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip("typst")
    from capture_double import finished_run
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding
    from cryptography.hazmat.primitives.serialization.pkcs12 import serialize_key_and_certificates
    from signing_keys import made_key

    from pipelines.archive.signatures import VARIABLE

    page = ROOT / "docs" / "how-to" / "issue-a-certificate.md"
    shown = outputs(page)
    assert [command.split()[1] for command, _ in shown] == ["certificate", "verify"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    finished_run(tmp_path)
    laboratory = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    Path("laboratory.toml").write_text(laboratory, encoding="utf-8")
    assert given("tumbleline certify latest")[0] == 0
    compared(*shown[0])
    (signed,) = re.findall(
        r"^\$ (tumbleline certificate .*--sign-with.*)$", page.read_text(encoding="utf-8"), re.MULTILINE
    )
    key = made_key(ec.generate_private_key(ec.SECP256R1()))
    locked = serialize_key_and_certificates(b"key", key.key, key.certificate, None, BestAvailableEncryption(b"secret"))
    Path("laboratory.p12").write_bytes(locked)
    Path("password").write_text("secret\n", encoding="utf-8")
    Path("laboratory.pem").write_bytes(key.certificate.public_bytes(Encoding.PEM))
    status, _, err = given(signed)
    assert status == 0, err
    Path("received").mkdir()
    for name in ("A1_1.pdf", "laboratory.pem"):
        shutil.copy(name, "received")
    monkeypatch.chdir("received")  # where no archive is
    compared(*shown[1])
