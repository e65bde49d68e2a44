"""Every reader of recordings that is found: the first bytes are its own, it reads its sample, and it is in the guide."""

import gc
import io
import struct
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from root_process import ROOT
from scipy.io import savemat, wavfile

from pipelines.export.waveforms import Channel, write_waveforms
from pipelines.importers import files, readers
from pipelines.importers.readers import READERS, reader_of
from schemas.errors import DataRejected, WrongUse

EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
GUIDE = (ROOT / "docs" / "how-to" / "import-your-data.md").read_text(encoding="utf-8")
TIME = np.arange(50) / 100.0
AXES = {name: 0.1 * k + 0.001 * np.sin(TIME * (k + 1)) for k, name in enumerate(("ax", "ay", "az"))}
REFUSED = {"zip": b"PK\x03\x04" + bytes(40)}
FROM_ELSEWHERE = {"ide": ("dynamic-files/enDAQ-test.ide", "32 16g DC Acceleration")}


def frame() -> pd.DataFrame:
    return pd.DataFrame({"time": TIME, **AXES})


def parquet(path: Path) -> None:
    frame().to_parquet(path)


def matlab(path: Path) -> None:
    with path.open("wb") as file:
        savemat(file, {name: frame()[name].to_numpy() for name in frame()})


def text(path: Path) -> None:
    frame().to_csv(path, index=False)


def hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in frame():
            file[name] = frame()[name].to_numpy()[None, :]  # MATLAB stores a column as a row
        file["rate"] = 100.0
        file["#refs#/a"] = np.arange(50.0)
    data = bytearray(path.read_bytes())
    data[:116] = b"MATLAB 7.3 MAT-file".ljust(116)
    path.write_bytes(data)


def exported(form: str, library: str) -> Callable[[Path], None]:
    """By the writer of the product, which uses the library of the format."""

    def make(path: Path) -> None:
        pytest.importorskip(library)
        channels = [Channel(name, "g", "log", values, 0.01, k) for k, (name, values) in enumerate(AXES.items())]
        write_waveforms(form, channels, path)

    return make


def rdata(path: Path) -> None:
    pytest.importorskip("rdata").write_rda(path, {"imu": frame()}, compression=None)


def wav(path: Path) -> None:
    wavfile.write(path, 100, (30000 * np.column_stack([*AXES.values()])).astype(np.int16))


def lvm(path: Path) -> None:
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,", "X_Columns\tOne",
            "***End_of_Header***\t", "\t", "Channels\t3", "Samples\t50\t50\t50", "Y_Unit_Label\tg\tg\tg",
            "Delta_X\t0,010000\t0,010000\t0,010000", "***End_of_Header***\t\t\t\t", "X_Value\tax\tay\taz\tComment"]  # fmt: skip
    rows = ["\t".join(f"{value:.9f}".replace(".", ",") for value in row) for row in frame().to_numpy()]
    path.write_text("\r\n".join([*head, *rows]) + "\r\n", encoding="utf-8")


def numpy(path: Path) -> None:
    records = np.array([*map(tuple, frame().to_numpy())], dtype=[(name, ">f8") for name in frame()])
    with path.open("wb") as file:
        np.save(file, records)


def spreadsheet(path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(list(frame()))
    for row in frame().to_numpy():
        book.active.append([float(value) for value in row])
    book.save(path)


def ulog(path: Path) -> None:
    """By the format's description, docs.px4.io: header, flags, format, subscription, data."""

    def message(kind: str, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), ord(kind)) + content

    definition = b"sensor_accel:uint64_t timestamp;float ax;float ay;float az;"
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 5_000_000), message("B", bytes(40)), message("F", definition)]
    parts.append(message("A", struct.pack("<BH", 0, 1) + b"sensor_accel"))
    for time, *values in frame().to_numpy():
        parts.append(message("D", struct.pack("<HQ3f", 1, 5_000_000 + round(1e6 * time), *values)))
    path.write_bytes(b"".join(parts))


def dataflash(path: Path) -> None:
    """By ArduPilot's LogStructure.h: formats, then messages."""

    def form(kind: int, length: int, name: bytes, types: bytes, columns: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, types, columns)

    parts = [form(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    parts.append(form(131, 24, b"IMU", b"QBfff", b"TimeUS,I,ax,ay,az"))
    for time, *values in frame().to_numpy():
        parts.append(b"\xa3\x95\x83" + struct.pack("<QB3f", round(1e6 * time), 0, *values))
    path.write_bytes(b"".join(parts))


IMU = """float64 ax
float64 ay
float64 az"""


def mcap(path: Path) -> None:
    writer = pytest.importorskip("mcap_ros2.writer")
    with path.open("wb") as file, writer.Writer(file) as out:
        kind = out.register_msgdef("own_msgs/msg/Acceleration", IMU)
        for time, *values in frame().to_numpy():
            stamp = round(1e9 * (1e9 + time))
            out.write_message("/imu", kind, dict(zip(AXES, map(float, values), strict=True)), stamp, stamp)


def bagged(bag: Path, package: str, distribution: str, serialize: str, **how: Any) -> Path:
    """A bag by the library, whose names are those of its two formats."""
    typesys, name = pytest.importorskip("rosbags.typesys"), "own_msgs/msg/Acceleration"
    store = typesys.get_typestore(typesys.Stores[distribution])
    store.register(typesys.get_types_from_msg(IMU, name))
    with import_module(f"rosbags.{package}").Writer(bag, **how) as out:
        connection = out.add_connection("/imu", name, typestore=store)
        for time, *values in frame().to_numpy():
            own = store.types[name](*map(float, values))
            out.write(connection, round(1e9 * (1e9 + time)), getattr(store, serialize)(own, connection.msgtype))
    return bag


def rosbag(path: Path) -> None:
    bagged(path.with_suffix(".bag"), "rosbag1", "ROS1_NOETIC", "serialize_ros1").rename(path)


def rosbag2(path: Path) -> None:
    plugin = pytest.importorskip("rosbags.rosbag2").StoragePlugin.SQLITE3
    how = {"version": 9, "storage_plugin": plugin}
    folder = bagged(path.with_suffix(".folder"), "rosbag2", "ROS2_JAZZY", "serialize_cdr", **how)
    next(folder.glob("*.db3")).rename(path)


def wearable(path: Path) -> None:
    """A CWA file by the description of the format, github.com/digitalinteraction/openmovement: Docs/ax3/ax3-technical.md."""
    pytest.importorskip("actfast")
    stamp = (26 << 26) | (3 << 22) | (4 << 17) | (10 << 12) | (20 << 6) | 30  # 2026-03-04 10:20:30
    counts = np.round(256 * np.column_stack([*AXES.values()])).astype("<i2")
    head = struct.pack("<2sHBHIH", b"MD", 1020, 0x17, 1234, 1, 0).ljust(36, b"\0") + bytes([0x4A])  # 100 Hz, 8 g
    block = struct.pack("<2sHHIIIHHBBBBhH", b"AX", 508, 0x8000, 1, 0, stamp, 0, 300, 0, 100, 0x4A, 0x32, 0, len(counts))
    block = (block + counts.tobytes()).ljust(510, b"\0")
    total = int(np.frombuffer(block, "<u2").sum(dtype=np.uint64))
    path.write_bytes(head.ljust(1024, b"\0") + block + struct.pack("<H", -total % 65536))


def mdf4(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(values, TIME, name=name, unit="g") for name, values in AXES.items()])
        made = file.save(path.with_suffix(".mf4"))
    Path(made).rename(path)


def miniseed(path: Path) -> None:
    pymseed = pytest.importorskip("pymseed")
    traces = pymseed.MS3TraceList()
    for letter, values in zip("xyz", AXES.values(), strict=True):
        traces.add_data(
            sourceid=f"FDSN:XX_TEST__H_N_{letter.upper()}", data_samples=[*map(float, values)], sample_type="d",
            sample_rate=100.0, starttime_str="2026-01-01T00:00:00Z",
        )  # fmt: skip
    traces.to_file(str(path))


SAMPLES = {
    "spreadsheet": spreadsheet, "ulog": ulog, "dataflash": dataflash, "mcap": mcap, "rosbag": rosbag, "mdf4": mdf4,
    "miniseed": miniseed, "rosbag2": rosbag2, "wearable": wearable,
    "numpy": numpy, "parquet": parquet, "matlab": matlab, "text": text, "hdf5": hdf5, "uff58": exported("uff58", "pyuff"),
    "tdms": exported("tdms", "nptdms"),
    "rdata": rdata, "wav": wav, "lvm": lvm,
}  # fmt: skip


@each(READERS)
def test_a_reader_says_what_it_is_and_is_in_the_guide(name: str) -> None:
    reader = READERS[name]
    assert name == reader.NAME
    assert reader.TITLE
    assert f"`{name}`" in GUIDE
    assert not reader.EXTRA or (reader.EXTRA in EXTRAS and f"tumbleline[{reader.EXTRA}]" in GUIDE)
    assert [other for other in READERS.values() if other.ORDER == reader.ORDER] == [reader]


def sample(name: str, path: Path, request: pytest.FixtureRequest) -> str:
    """A file of a format at a path; the group of its channels."""
    if name in FROM_ELSEWHERE:
        pytest.importorskip("idelib")
        file, group = FROM_ELSEWHERE[name]
        path.write_bytes((request.getfixturevalue("shared_data") / file).read_bytes())
        return group
    SAMPLES[name](path)
    return ""


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of libraries that leave damaged files
@each(READERS)
def test_a_reader_reads_its_sample_which_no_other_claims_and_refuses_a_damaged_one(
    name: str, tmp_path: Path, request, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "no-ending"
    if name == "mdf4":  # the end of a damaged one fails, and its traceback keeps it until a later test
        monkeypatch.setattr(pytest.importorskip("asammdf.blocks.mdf_v4").MDF4, "__del__", closed)
    group = "" if name in REFUSED else sample(name, path, request)
    if name in REFUSED:
        path.write_bytes(REFUSED[name])
    data = path.read_bytes()
    assert reader_of(data) is READERS[name]
    others = [other for other, reader in READERS.items() if other not in {name, "text"} and reader.recognised(data)]
    assert others == []
    if name in REFUSED:
        with pytest.raises(DataRejected, match="which is not read"):
            files.read(path)
        return
    # in this process: in that of the readers their libraries would be loaded once more, for some of them after every refusal
    content, source = files.content_here(path, group)
    assert source.form == name
    if name in SAMPLES:
        check(name, content)
    for number, damaged in enumerate(spoilt(data)):
        wrong = tmp_path / f"short-{number}"
        wrong.write_bytes(damaged)
        message, rows = wrong.name, 1
        try:
            rows = len(files.content_here(wrong, group)[0].table)
        except (DataRejected, WrongUse) as problem:
            message = str(problem)
        assert message.startswith("short")
        assert "\n" not in message
        assert 0 < rows <= 60_000
    gc.collect()  # objects of libraries that keep a damaged file open end here


def closed(file: Any) -> None:
    """Close a file of a library, whatever it lacks."""
    with suppress(Exception):
        file.close()


def spoilt(data: bytes) -> Iterator[bytes]:
    """A file that ends too early, and one of which some bytes are others."""
    rng = np.random.default_rng(5)
    yield from (data[: int(share * len(data))] for share in (0.4, 0.97))
    for count in (4, 8):
        other = bytearray(data)
        for place in rng.integers(8, max(len(data), 9), count):
            other[min(int(place), len(data) - 1)] = int(rng.integers(256))
        yield bytes(other)


def check(name: str, content) -> None:
    """The sample's numbers; and unit and interval where the format has a place for them."""
    table = content.table
    time = table[next(one for one in table if str(one) in {"time", "X_Value"})].to_numpy(dtype=float)
    np.testing.assert_allclose(time, TIME, atol=1e-9)
    columns = [one for one in table if str(one) not in {"time", "X_Value", "temperature"}]
    assert len(columns) == 3
    tolerance = {"wav": 1 / 30000, "wearable": 1 / 512}.get(name, 1e-6)  # half a count
    scale = 1 / 30000 if name == "wav" else 1.0
    for column, values in zip(columns, AXES.values(), strict=True):
        np.testing.assert_allclose(scale * table[column].to_numpy(dtype=float), values, atol=tolerance)
    if name in {"uff58", "tdms", "lvm"}:
        assert {content.units[str(one)] for one in columns} == {"g"}
        assert content.interval_s == pytest.approx(0.01)


@each([name for name, reader in READERS.items() if reader.EXTRA])
def test_a_missing_library_is_named_with_its_installation(name: str, monkeypatch) -> None:
    def missing(module: str):
        raise ImportError(module)

    monkeypatch.setattr("schemas.library.import_module", missing)
    with pytest.raises(WrongUse, match=rf"install it with: pip install 'tumbleline\[{READERS[name].EXTRA}\]'"):
        READERS[name].read("a.bin", b"RDX3\n" + bytes(100), "")


def test_several_groups_of_channels_are_asked_about(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        for group, count in (("fast", 40), ("slow", 4)):
            writer.write_segment([nptdms.ChannelObject(group, name, np.arange(float(count))) for name in AXES])
    (tmp_path / "a.tdms").write_bytes(sink.getvalue())
    with pytest.raises(
        WrongUse, match=r"2 groups .*'fast' \(40 samples\), 'slow' \(4 samples\); choose one with --set group=NAME"
    ):
        files.read_content(tmp_path / "a.tdms")
    with pytest.raises(WrongUse, match=r"no group is called 'fas'.*fast"):
        files.read_content(tmp_path / "a.tdms", "fas")
    assert len(files.read_content(tmp_path / "a.tdms", "slow")[0].table) == 4


def test_a_matlab_file_with_a_bad_checksum_is_refused_with_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "torn.mat"
    savemat(path, {name: frame()[name].to_numpy() for name in frame()}, do_compression=True)
    data = bytearray(path.read_bytes())
    end = 136 + int.from_bytes(data[132:136], "little")
    data[end - 4 : end] = bytes(4)  # the Adler-32 sum behind the first variable
    path.write_bytes(data)
    with pytest.raises(DataRejected, match=r"torn\.mat.*incorrect data check.*copy it again"):
        files.read(path)


def test_no_other_file_names_a_reader_text_is_tried_last_and_one_extra_has_every_optional_format() -> None:
    assert list(READERS)[-1] == "text"
    wanted = sorted({reader.EXTRA for reader in READERS.values() if reader.EXTRA})
    assert EXTRAS["recordings"] == [f"tumbleline[{','.join(wanted)}]"]
    folder = Path(readers.__file__).parent
    names = [f"{readers.__name__}.{one.__name__.rpartition('.')[2]} import" for one in READERS.values()]
    texts = {
        path.relative_to(ROOT): path.read_text(encoding="utf-8")
        for room in ("inertial", "schemas", "stations", "pipelines")
        for path in (ROOT / room).rglob("*.py")
        if not path.is_relative_to(folder)
    }
    assert [(path, name) for path, text in texts.items() for name in names if name in text] == []
