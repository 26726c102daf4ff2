"""Hostile files made by hand, beside those the fuzzer finds: bombs, depth, entities, names, things
that are no files.
"""

import gzip
import io
import os
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

from fuzz.archives import npy_header, plain_npy
from fuzz.seeds import csv_file, model_files, npz_members, robot_file, urdf_files
from runtime.compose import read_record
from runtime.core.errors import InputError
from runtime.core.model import load_model
from runtime.reading.files import read_bytes
from runtime.reading.settings import RecordSettings
from runtime.study import load_study
from symgen.description import load_robot
from symgen.errors import DescriptionError

PLANAR = robot_file("planar_2r").decode()
STUDY = "record: {files: [a.csv]}\n"


def refused(reader, name, content, said=""):
    outcome = reader(
        name, content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    )
    assert outcome.kind == "refused", outcome
    assert said in outcome.text, outcome.text


LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 12)
)
YAML = {
    "alias bomb": (LAUGHS, "anchors and aliases"),
    "alias of itself": ("a: &a [*a]\n", "anchors and aliases"),
    "merge keys": ("a: {<<: {b: 1}}\n", ""),
    "lists": ("a: " + "[" * 10_000 + "\n", "nested"),
    "closed lists": ("a: " + "[" * 10_000 + "]" * 10_000 + "\n", "nested"),
    "tables": ("a: " + "{a: " * 10_000 + "\n", "nested"),
    "tables as keys": ("{" * 10_000 + "\n", ""),
    "indented": ("".join(" " * k + "a:\n" for k in range(600)), "nested"),
    "dashes": ("a:\n" + "- " * 10_000 + "1\n", "nested"),
    "objects": ("a: !!python/object/apply:os.system [id]\n", "tags"),
    "nul": ("a: \x00\n", "not YAML"),
    "surrogate": ("a: \ud800\n", "UTF-8"),
    "long text": ("a: " + "x" * 3_000_000 + "\n", ""),
    "many values": ("a: [" + "1," * 150_000 + "1]\n", ""),
    "utf-16": (b"\xff\xfe" + "symgen: 1\n".encode("utf-16-le"), ""),
}


@pytest.mark.parametrize("format", ["robot", "study"])
@pytest.mark.parametrize("name", YAML)
def test_yaml(reader, format, name):
    text, said = YAML[name]
    refused(
        reader,
        format,
        text,
        said if format != "robot" or name not in ("long text", "many values") else "",
    )


@pytest.mark.parametrize(
    "expression",
    ["9**9**9**9", "10**10000", "1e999999999", "1" + "0" * 1900, "(" * 1000 + "1" + ")" * 1000, "(1+D2)**32", "1/0", "0**-1", "sqrt(-1)"]
    + ["((q1+D2)**8)**8", "-" * 1900 + "x", "__import__('os')", "q1.__class__", "lambda: 0", "D2 if 1 else 2", "1_0", "0x10", "٣", "1e-400*x"],
)  # fmt: skip
def test_expressions(reader, expression):
    refused(reader, "robot", PLANAR.replace("d: D2", f'd: "{expression}"'), "frames.2.d")


@pytest.mark.parametrize(
    "name",
    ["../evil", "a/b", "a\\b", "..", ".", "", "a b", "a-b", "1a", "class", "é", "a\\0b", "CON", "nul", "Lpt1", "__init__", "a" * 41, "a.py", "~", "$HOME"],
)  # fmt: skip
def test_names_of_robots(reader, name):
    refused(reader, "robot", PLANAR.replace("name: planar_2r", f'name: "{name}"'))


@pytest.mark.parametrize(
    "name",
    [
        "q",
        "tau",
        "np",
        "pi",
        "class",
        "__class__",
        "__builtins__",
        "q1",
        "XX1",
        "ZZ1R",
        "lambda",
        "D2)",
        "a b",
        "x" * 50,
        "out",
        "None",
    ],
)
def test_names_of_constants(reader, name):
    refused(reader, "robot", PLANAR.replace("constants: {", f'constants: {{"{name}": 1.0, '))


@pytest.mark.parametrize(
    "doctype",
    [
        (
            '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c '
            '"&b;&b;&b;&b;&b;&b;&b;&b;">]>'
        ),
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE robot SYSTEM "http://localhost:9/robot.dtd">',
        '<!DOCTYPE robot [<!ENTITY % p SYSTEM "file:///dev/zero"> %p;]>',
        "<!DOCTYPE robot>",
    ],
)
def test_document_types(reader, doctype):
    refused(
        reader,
        "urdf",
        doctype.encode() + urdf_files()[0].split(b"?>")[-1],
        "a document type or an entity",
    )


def test_nested_and_endless_xml(reader):
    refused(reader, "urdf", "<robot>" + "<a>" * 100_000, "nested")
    refused(reader, "urdf", "<robot>" + "<a/>" * 100_000 + "</robot>", "elements")
    refused(reader, "urdf", "<robot name='" + "x" * 6_000_000, "bytes")


@pytest.mark.parametrize(
    "mesh",
    [
        "../../../etc/passwd",
        "/dev/zero",
        "file:///dev/zero",
        "package://x/../../y.dae",
        "http://localhost:9/x.stl",
    ],
)
def test_meshes_are_never_opened(tmp_path, monkeypatch, mesh):
    geometry = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual>'
    path = tmp_path / "arm.urdf"
    path.write_bytes(urdf_files()[0].replace(b"<inertial>", geometry.encode() + b"<inertial>"))
    opened, original = [], Path.open
    monkeypatch.setattr(
        Path, "open", lambda self, *a, **k: opened.append(self) or original(self, *a, **k)
    )
    monkeypatch.setattr("builtins.open", lambda *a, **k: pytest.fail(f"opened {a}"))
    load_robot(path)
    assert opened == [path]


# --- records
# ----------------------------------------------------------------------------------------------------------


def archive(members, method=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as found:
        for name, data in members.items():
            found.writestr(name, data)
    return bytearray(stream.getvalue())


@campaign
def test_zip_bombs(reader):
    zeros = npy_header("{'descr': '<f8', 'fortran_order': False, 'shape': (7500000,)}\n") + bytes(
        60_000_000
    )
    bomb = archive(dict.fromkeys(npz_members(), zeros))
    assert len(bomb) < 1_000_000
    refused(reader, "npz", bytes(bomb), "unpacks to")
    at = bomb.rindex(
        b"PK\x01\x02", 0, bomb.index(b"q1.npy", bomb.index(b"PK\x01\x02"))
    )  # its entry in the table says 100 bytes
    struct.pack_into("<I", bomb, at + 24, 100)
    outcome = reader("npz", bytes(bomb))
    assert not outcome.fault, outcome
    refused(
        reader,
        "npz",
        bytes(archive({f"x{k}.npy": b"" for k in range(20_000)}, zipfile.ZIP_STORED)),
        "20000 arrays",
    )
    refused(reader, "npz", bytes(archive({"a.npz": bytes(archive(npz_members()))})), "case.npz")


def test_members_that_overlap_and_names_that_climb(reader, tmp_path):
    data = archive({**npz_members(), "../../evil.npy": plain_npy(np.zeros(12))}, zipfile.ZIP_STORED)
    assert (
        reader("npz", bytes(data)).kind == "ok"
    )  # read from memory: nothing is ever written by a member's name
    entries = [k for k in range(len(data)) if data[k : k + 4] == b"PK\x01\x02"]
    for at in entries:
        struct.pack_into("<I", data, at + 42, 0)  # all begin where the first begins
    refused(reader, "npz", bytes(data), "case.npz")


@campaign
def test_gzip_bombs(reader):
    refused(reader, "csv.gz", gzip.compress(b"1," * 150_000_000, 1), "unpacks to")
    for unit in (b"\n", b"1,", b"\x00"):
        refused(reader, "csv.gz", gzip.compress(unit * (30_000_000 // len(unit)), 1), "case.csv.gz")
    refused(reader, "csv.gz", gzip.compress(b"12\n" * 4_000_000, 1), "case.csv.gz")


@campaign
def test_lines_without_end(reader):
    refused(reader, "csv", b"1" * 20_000_000, "no columns q1, q2")
    refused(reader, "csv", b"," * 10_000_000, "columns; expected at most")
    refused(reader, "csv", b"," * 900_000, "columns; expected at most")
    refused(reader, "csv", csv_file() + b"," * 10_000_000, "10000001 fields; expected")
    refused(reader, "csv", b"\n" * 8_000_000, "no line of numbers")


@campaign
def test_parquet_bombs(reader, tmp_path):
    """A constant column of any length takes no space."""
    import polars

    stream = io.BytesIO()
    polars.select(
        q1=polars.repeat(1.0, 40_000_000), tau1=polars.repeat(1.0, 40_000_000)
    ).write_parquet(stream, row_group_size=40_000_000)
    assert len(stream.getvalue()) < 1_000_000
    refused(reader, "parquet", stream.getvalue(), "unpacks to")


@campaign
def test_matlab_declares_more_than_it_holds(reader):
    def element(kind, data, length=None):
        return struct.pack("<II", kind, len(data) if length is None else length) + data

    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    flags, name = element(6, struct.pack("<II", 6, 0)), element(1, b"q1".ljust(8, b"\0"), 2)
    for n, m in ((2**31 - 1, 2**31 - 1), (2**30, 1), (-1, -1), (-1, 12)):
        array = flags + element(5, struct.pack("<ii", n, m)) + name + element(9, bytes(96))
        refused(reader, "mat", head + element(14, array), "case.mat")
    refused(reader, "mat", head + element(14, flags, 2**32 - 8), "damaged")
    cell = element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<ii", 1, 1)) + name
    nested = b""
    for _ in range(2000):
        nested = element(14, cell + nested)
    refused(reader, "mat", head + nested, "no columns")


def test_generated_modules(reader):
    for text in (
        "(" * 10_000 + ")" * 10_000,
        "x = " + "-" * 100_000 + "1",
        "x = " + "[" * 150 + "]" * 150,
        "x = " + "+".join(["1"] * 50_000),
    ):
        refused(reader, "model", text, "case")
    refused(
        reader, "model", model_files()[0] + b"\nx = " + b"(" * 5000 + b"1" + b")" * 5000, "case"
    )


# --- what is no file
# --------------------------------------------------------------------------------------------------


def special(kind, folder, ending):
    path = folder / f"thing{ending}"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "missing":
        return path
    elif kind == "nul":
        return folder / f"a\x00b{ending}"
    elif kind == "long":
        return folder / f"{'a' * 5000}{ending}"
    else:
        path.symlink_to(kind)
    return path


KINDS = ["fifo", "folder", "loop", "missing", "nul", "long", "/dev/zero", "/dev/full", "/dev/null"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_file(tmp_path, kind):
    """No pipe is waited for, no device read to its end. The system's own error of a name that is
    too long is one line on the command line.
    """
    expected = (InputError, OSError) if kind == "long" else InputError
    for ending in (".yaml", ".par", ".urdf"):
        with pytest.raises(DescriptionError):
            load_robot(special(kind, tmp_path, ending))
        if ending == ".yaml" and kind not in ("missing", "nul", "long"):
            with pytest.raises(expected):
                load_study(tmp_path / "thing.yaml")
    for ending in (".csv", ".npz", ".npy", ".mat", ".parquet", ".csv.gz", ".bag", ".db3", ".mcap"):
        path = special(kind, tmp_path, ending)
        with pytest.raises(expected):
            read_record(RecordSettings(files=(str(path),)))
    with pytest.raises(expected):
        load_model(special(kind, tmp_path, ".py"))


def test_large_files(tmp_path):
    """100 MB where some kilobytes are expected, and what no memory holds."""
    for ending, load in ((".yaml", load_robot), (".par", load_robot), (".urdf", load_robot)):
        path = tmp_path / f"large{ending}"
        with path.open("wb") as file:
            file.truncate(100_000_000)
        with pytest.raises(DescriptionError, match="bytes"):
            load(path)
    with pytest.raises(InputError, match="bytes"):
        load_study(tmp_path / "large.yaml")
    with (tmp_path / "large.csv").open("wb") as file:
        file.truncate(10_000_000_000)
    with pytest.raises(InputError, match="cut the file into shorter records"):
        read_bytes(tmp_path / "large.csv")


@pytest.mark.parametrize("data", ["/dev/null", "/nonexistent", "/proc/self/mem", "\n", "a" * 5000])
def test_symgen_data(monkeypatch, tmp_path, data):
    from runtime.reading.datasets import locate

    monkeypatch.setenv("SYMGEN_DATA", data)
    assert locate("emps", "DATA_EMPS.mat", cache=tmp_path) is None


@pytest.mark.parametrize("dataset", ["../x", "/etc", "tx40/../../x", "", "tx40\x00"])
def test_names_of_data_sets(dataset):
    with pytest.raises(InputError, match="no dataset"):
        read_record(RecordSettings(files=("passwd",), dataset=dataset))


def test_files_of_data_sets_do_not_climb():
    with pytest.raises(InputError, match="no file"):
        read_record(RecordSettings(files=("../../../etc/passwd",), dataset="tx40"))
