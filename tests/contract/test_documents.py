"""What commands print with ``--json`` is what the types of the documents say, and their page is written from the types."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from in_process import given
from pydantic import TypeAdapter, ValidationError
from root_process import ROOT
from second_order import step_response

from deploy.release import unpack
from docs.documents_page import documents, head_of
from inertial.dynamics.spectra import transfer
from pipelines import cli
from pipelines.chain import certify as certifying
from pipelines.cli import COMMANDS

KEPT = ROOT / "tests" / "archives" / "v1.tar.xz"
BY_HEAD = {head_of(kind): kind for kind in documents()}
CASES = {
    "show RUN --json": ["show"],
    "show RUN TABLE --json": ["show", "latest", "coefficients"],
    "show UNIT --at DATE --json": ["show", "A1", "--at", "2026-06-01"],
    "verify --json": ["verify"],
    "rerun --check --json": ["rerun", "latest", "--check"],
    "archive diff --json": ["archive", "diff", "latest", "latest"],
    "release whatif --json": ["release", "whatif", "{folder}/model.toml"],
    "import FILE --procedure sweep": ["import", "{folder}/sweep.csv", "--procedure", "sweep", "--units", "S1"],
    "import FILE… --procedure NAME --map reference=…": [
        "import", *(f"{{folder}}/step{n}.csv" for n in range(4)), "--units", "S1", "--procedure", "step_response",
        "--map", "z=out [V],reference=drive [V]", "--rate", "50000",
    ],
    "doctor --json": ["doctor"],
    "station monitor --json": ["station", "monitor"],
    "show RUN --report --json": ["show", "latest", "--report"],
    "release MODEL --json": [
        "release", "{folder}/model.toml", "--since", "2026-01-01", "--force", "--reason", "a test",
    ],
    "release --json": ["release"],
    "certificate list --json": ["certificate", "list"],
    "certificate revoke UNIT --json": ["certificate", "revoke", "A1", "--reason", "a test"],
    "lineage UNIT|RUN|FILE --json": ["lineage", "A1"],
    "station profiles --json": ["station", "profiles"],
    "station frames --json": ["station", "frames", str(ROOT / "tests" / "data" / "frames" / "mbpoll-tcpdump.pcap")],
    "archive clean --json": ["archive", "clean", "--dry-run"],
    "archive key --json": ["archive", "key", "--output", "{folder}/key.pem"],
    "archive compact --json": ["archive", "compact"],
    "attributes add --json": ["attributes", "add", "{folder}/units.csv"],
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
        validate(BY_HEAD["certificate issue --json"], out)
    model = '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment"]\n'
    (folder / "model.toml").write_text(model, encoding="utf-8")
    (folder / "units.csv").write_text("serial,wafer\nA1,W1\n", encoding="utf-8")
    rng = np.random.default_rng(1)
    time = np.arange(1000) / 50e3 - 0.003
    for n in range(4):
        output = 0.3 * step_response(time, 900.0, 0.6) + 1e-4 * rng.normal(size=1000)
        step = np.column_stack([output, 2.0 * (time > 0.0)])
        np.savetxt(folder / f"step{n}.csv", step, delimiter=",", header="out [V],drive [V]", comments="")
    f = np.geomspace(5.0, 4000.0, 30)
    h = -transfer(f, 2500.0, 0.7)
    rows = [f"{a:.6g},{abs(b):.6g},{np.degrees(np.angle(b)):.6g},0.2,0.2" for a, b in zip(f, h, strict=True)]
    head = "frequency_hz,magnitude,phase_deg,magnitude_uncertainty_percent,phase_uncertainty_deg"
    (folder / "sweep.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    return folder


def validate(kind: type, text: str) -> None:
    """Refuse a document with a value of another type, or a key that is missing or that the type does not have."""
    TypeAdapter(kind).validate_json(text, strict=True, extra="forbid")


@pytest.mark.parametrize("head", CASES)
def test_a_command_prints_the_document_of_its_type(head: str, kept: Path, tmp_path: Path) -> None:
    shutil.copytree(kept, tmp_path / "own")
    words = [word.format(folder=tmp_path / "own") for word in CASES[head]]
    place = [] if head.removesuffix(" --json") in WITHOUT_ARCHIVE else ["--archive", tmp_path / "own" / "archive"]
    status, out, err = given(*words, "--json", *place)
    assert status in (0, 1), err
    validate(BY_HEAD[head], out)


ELSEWHERE = {
    "plan keys [SUBJECT] --json": "contract/test_keys.py",
    "audit --json": "e2e/test_audit.py",
    "archive query --json": "e2e/test_audit.py",
    "list --json": "e2e/test_command_line.py",
    "run --json": "e2e/test_command_line.py",
    "correct --json": "e2e/test_correct.py",
    "discover --json": "e2e/test_discover.py",
    "attributes list --json": "e2e/test_discover.py",
    "inspect FILE --json": "e2e/test_import.py",
    "import FILE… --json": "e2e/test_import.py",
    "import FILE FILE… --json": "e2e/test_import.py",
    "compare --json": "e2e/test_models.py",
    "history --json": "e2e/test_models.py",
    "extend --json": "e2e/test_models.py",
    "noise allan --json": "e2e/test_noise_commands.py",
    "noise psd --json": "e2e/test_noise_commands.py",
    "plan --json": "e2e/test_plan.py",
    "rerun --json": "e2e/test_run_that_ends.py",
    "station status --json": "e2e/test_station_commands.py",
    "station check --json": "e2e/test_station_commands.py",
    "station log --json": "e2e/test_station_commands.py",
    "station watch --json": "e2e/test_station_commands.py",
    "diagnose --json": "e2e/test_diagnosis.py",
    "improve --json": "e2e/test_models.py",
    "run --json (several fillings)": "e2e/test_operator.py",
    "show RUN --json (no grades)": "e2e/test_inquiry.py",
    "investigate --json": "e2e/test_inquiry.py",
    "station operator --json": "e2e/test_inquiry.py",
    "plan order --json": "e2e/test_run_that_ends.py",
    "discover --explain ID --json": "e2e/test_discover.py",
    "demo --lots N --json": "e2e/test_discover.py",
    "discover --json --explain ID": "e2e/test_discover.py",
    "certificate write --json": "unit/pipelines/certificates/document/test_compose.py",
    "verify FILE… --json": "unit/pipelines/certificates/document/test_file_check.py",
    "certificate issue --json": "contract/test_documents.py",
    "station program --json": "faults/test_programming.py",
    "station program --format teds --json": "e2e/test_one_axis.py",
    "fit --json (an import)": "e2e/test_imported_recording.py",
    "plan choose --json": "unit/pipelines/planning/test_choice.py",
    "plan line --json": "e2e/test_plan_line.py",
    "simulate --json": "e2e/test_correct.py",
    "demo --yes --json": "e2e/test_models.py",
    "demo --by-hand --json": "e2e/test_models.py",
    "demo --station --json": "e2e/test_practice.py",
    "station serve --json": "e2e/test_station.py",
    "station bring-up --json": "e2e/test_bring_up.py",
    "station replay --json": "e2e/test_frame_recordings.py",
    "archive restore --json": "e2e/test_backup.py",
}
"""Documents that other tests hold against their types."""


def test_every_typed_document_is_printed_by_a_test_and_names_a_command() -> None:
    assert set(BY_HEAD) - set(CASES) == set(ELSEWHERE)
    assert [path for path in ELSEWHERE.values() if not (ROOT / "tests" / path).is_file()] == []
    assert {head.split()[0] for head in BY_HEAD} <= set(COMMANDS)
    # every command has one whose module has the option ``--json`` itself
    modules = Path(cli.__file__).parent.glob("*.py")
    printing = {path.stem.rstrip("_") for path in modules if "JsonOption" in path.read_text(encoding="utf-8")}
    of_a_format = {"export"}  # its --json is the format json: tests/contract/test_export_formats.py
    assert (printing & set(COMMANDS)) - of_a_format == {head.split()[0] for head in BY_HEAD} & printing


def test_a_document_with_another_key_or_type_is_refused_and_a_key_that_is_not_required_may_be_missing() -> None:
    document, checked = {"archive": "a", "runs": []}, {"run": "r", "same": True}
    validate(BY_HEAD["list --json"], json.dumps(document))
    for wrong in ({"more": 1}, {"archive": 1}, {"runs": [{"id": "r"}]}):
        with pytest.raises(ValidationError):
            validate(BY_HEAD["list --json"], json.dumps(document | wrong))
    validate(BY_HEAD["rerun --check --json"], json.dumps({"selected": 1, "same": 1, "runs": [checked]}))
    with pytest.raises(ValidationError, match="same"):
        validate(BY_HEAD["rerun --check --json"], json.dumps({"selected": 1, "runs": [checked]}))
