"""MATLAB files of every version: the same columns, what is no array refused by name, nothing
followed out of the file.
"""

import sys
from io import BytesIO

import h5py
import numpy as np
import pytest
import scipy.io
from campaign import campaign
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from runtime.ground.errors import InputError
from runtime.reading.formats import read_table
from runtime.reading.mat import read_mat as table_of
from runtime.reading.table import Options

T = np.arange(12) / 200
Q = np.stack([np.sin(T), np.cos(T)], axis=1)


@pytest.fixture
def read_mat(tmp_path):
    """Table of the bytes of a .mat file."""

    def read(data, name="a.mat"):
        (tmp_path / name).write_bytes(data)
        return table_of(tmp_path / name, Options())

    return read


def stacked(table, names):
    """The named columns side by side."""
    return table.read(names)


def matlab(archive, name, x, kind="double"):
    """An array as MATLAB writes it: by columns, scalars and vectors with two dimensions, its class
    beside it.
    """
    x = np.atleast_2d(x)
    archive.create_dataset(name, data=x.T).attrs["MATLAB_class"] = np.bytes_(kind)


def file_73(write, head=512):
    """Bytes of a file of version 7.3: HDF5 behind a text of 512 bytes."""
    stream = BytesIO()
    with h5py.File(stream, "w", userblock_size=head) as archive:
        write(archive)
    data = bytearray(stream.getvalue())
    data[:124] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124)
    data[124:128] = b"\x00\x02IM"
    return bytes(data)


def everything(archive):
    matlab(archive, "t", T[:, None])
    matlab(archive, "row", T[None, :])
    matlab(archive, "q", Q)
    matlab(archive, "gain", 2.5)
    matlab(archive, "counts", (1000 * Q).astype(np.int32), "int32")
    matlab(archive, "on", (Q > 0).astype(np.uint8), "logical")
    matlab(archive, "text", np.frombuffer("abc".encode("utf-16-le"), np.uint16)[None, :], "char")
    cell = archive.create_dataset("cell", data=np.empty((1, 1), dtype=h5py.ref_dtype))
    cell.attrs["MATLAB_class"] = np.bytes_("cell")
    archive.create_group("#refs#")
    archive.create_group("log").attrs["MATLAB_class"] = np.bytes_("struct")
    archive.create_group("sparse").attrs["MATLAB_sparse"] = np.uint64(3)
    empty = archive.create_dataset("empty", data=np.array([0, 0], dtype=np.uint64))
    empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), np.uint8(1)


def test_version_73_reads_as_version_7(read_mat):
    stream = BytesIO()
    scipy.io.savemat(
        stream,
        {
            "t": T[:, None],
            "row": T[None, :],
            "q": Q,
            "gain": 2.5,
            "counts": (1000 * Q).astype(np.int32),
        },
    )
    old, new = read_mat(stream.getvalue(), "a.mat"), read_mat(file_73(everything), "a.mat")
    for names in (["t", "q"], ["row"], ["counts"]):
        np.testing.assert_array_equal(stacked(new, names), stacked(old, names))
    np.testing.assert_array_equal(stacked(new, ["t", "q"]), np.column_stack([T, Q]))
    np.testing.assert_array_equal(stacked(new, ["on"]), Q > 0)
    assert new.scalar("gain") == old.scalar("gain") == 2.5
    with pytest.raises(InputError, match="column 'empty': no samples"):
        stacked(new, ["empty"])
    assert set(new.names) == {"t", "row", "q", "gain", "counts", "on", "empty"}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("cell", "a MATLAB cell"),
        ("log", "a MATLAB struct"),
        ("text", "a MATLAB char"),
        ("sparse", "a MATLAB sparse matrix"),
    ],
)
def test_what_is_no_array_is_refused_by_name(read_mat, name, said):
    stream = BytesIO()
    cell = np.empty((1, 1), dtype=object)
    cell[0, 0] = T
    scipy.io.savemat(
        stream, {"cell": cell, "log": {"x": T}, "text": "abc", "sparse": scipy.sparse.eye(3)}
    )
    for data in (stream.getvalue(), file_73(everything)):
        with pytest.raises(InputError) as e:
            stacked(read_mat(data, "a.mat"), [name])
        assert f"column '{name}'" in str(e.value) and said.split()[
            -2 if "sparse" in name else -1
        ] in str(e.value)


@pytest.mark.parametrize("packed", [False, True])
def test_versions_5_to_7_read_as_scipy_reads_them(read_mat, packed):
    """Every class of numbers, stored as it is or narrower, beside what is no array."""
    rng = np.random.default_rng(1)
    written = {
        f"x{k}": (100 * rng.random((7, 3))).astype(kind)
        for k, kind in enumerate(["d", "f", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
    }
    written |= {
        "whole": np.arange(12.0),
        "cube": rng.random((2, 3, 4)),
        "none": np.empty((0, 3)),
        "one": 2.5,
        "a": 7,
        "text": "abc",
        "z": 1j * T,
    }
    stream = BytesIO()
    scipy.io.savemat(stream, written, do_compression=packed, long_field_names=True)
    table, expected = read_mat(stream.getvalue(), "a.mat"), scipy.io.loadmat(stream)
    assert set(table.names) == set(written) - {"text", "z"} and set(table.refused) == {"text", "z"}
    for name in table.names:
        np.testing.assert_array_equal(table.columns[name], expected[name])
    with pytest.raises(InputError, match="complex"):
        stacked(table, ["z"])


def test_links_are_not_followed(read_mat, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = T
    (tmp_path / "raw.bin").write_bytes(T.tobytes())

    def write(archive):
        archive["external"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/x")
        archive["soft"] = h5py.SoftLink("/nowhere")
        archive.create_dataset("raw", (12,), "f8", external=[(str(tmp_path / "raw.bin"), 0, 96)])
        layout = h5py.VirtualLayout((12,), "f8")
        layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "x", (12,))
        archive.create_virtual_dataset("virtual", layout)

    table = read_mat(file_73(write), "a.mat")
    assert table.names == ()
    for name in ("external", "soft"):
        with pytest.raises(InputError, match="a link"):
            stacked(table, [name])
    for name in ("raw", "virtual"):
        with pytest.raises(InputError, match="stored in another file"):
            stacked(table, [name])


def test_more_than_there_is_memory_for_is_refused(tmp_path):
    """An array that is declared, of 48 TB, and never stored."""
    declared = file_73(
        lambda archive: archive.create_dataset(
            "q", (10**12, 6), "f8", chunks=(1000, 6), compression="gzip"
        )
    )
    assert len(declared) < 3_000_000
    (tmp_path / "a.mat").write_bytes(declared)
    with pytest.raises(InputError, match=r"a\.mat: needs more memory than available"):
        read_table(tmp_path / "a.mat")


def test_without_h5py(tmp_path, monkeypatch):
    (tmp_path / "a.mat").write_bytes(file_73(everything))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(
        InputError,
        match=r"a\.mat: a MATLAB file needs an optional library: pip install symgen\[tables\]",
    ):
        read_table(tmp_path / "a.mat")


@campaign  # by default: tests/fuzz, format mat
@settings(
    max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_damaged_files_are_named(tmp_path, data):
    """Cut short or with 8 bytes changed: numbers or an InputError."""
    stream = BytesIO()
    scipy.io.savemat(stream, {"q": Q, "x": {"y": T}}, do_compression=True)
    for whole in (stream.getvalue(), file_73(lambda archive: matlab(archive, "q", Q))):
        spoiled = bytearray(
            whole[: data.draw(st.integers(0, len(whole)))] if data.draw(st.booleans()) else whole
        )
        if spoiled:
            place = data.draw(st.integers(0, len(spoiled) - 1))
            spoiled[place : place + 8] = data.draw(st.binary(min_size=8, max_size=8))
        (tmp_path / "a.mat").write_bytes(spoiled)
        try:
            stacked(read_table(tmp_path / "a.mat"), ["q"])
        except InputError as e:
            assert "a.mat" in str(e)
