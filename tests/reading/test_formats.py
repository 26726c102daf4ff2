"""One measured record in every format gives the same bits where the study declares the rate, and
the same parameters to 1e-9 from its time stamps.

The TX40 record, one sample in five, motor side. The whole record is run by `python
tests/reading/test_formats.py`.
"""

import gzip
import json
import sys
from pathlib import Path

import h5py
import numpy as np
import polars
import pytest
import scipy.io
from bag_files import joint_states, write_bag
from campaign import sampled
from problems import linear_system

from runtime import load_model, observe
from runtime.core.essential import essential_of
from runtime.reading.datasets import dataset_study, fetch
from runtime.reading.records import read_records
from runtime.study import study_from_mapping

FORMATS = (
    "csv",
    "csv.gz",
    "parquet",
    "mat 5",
    "mat 7",
    "mat 7.3",
    "npz",
    "npy",
    "ros1",
    "sqlite3",
    "mcap",
    "bare mcap",
)
JOINTS = [f"joint_{j}" for j in range(1, 7)]
START = 1_718_000_000_000_000_000  # ns, of the stamps of the bags
KEEP = 5


def write(kind, folder, t, q, tau):
    """The record as a file of this kind, and the names of its columns in a study."""
    path = folder / f"record_{kind.replace(' ', '_').replace('.', '_')}"
    named = {
        "t": t,
        **{f"q{j + 1}": q[:, j] for j in range(6)},
        **{f"tau{j + 1}": tau[:, j] for j in range(6)},
    }
    columns = {"q": [f"q{j + 1}" for j in range(6)], "tau": [f"tau{j + 1}" for j in range(6)]}
    if kind.startswith("csv"):
        path = path.with_suffix(f".{kind}")
        lines = [
            ",".join(named),
            *(",".join(map(repr, row)) for row in np.column_stack(list(named.values())).tolist()),
        ]
        data = "\n".join(lines).encode()
        path.write_bytes(gzip.compress(data, 1) if kind.endswith("gz") else data)
    elif kind == "parquet":
        path = path.with_suffix(".parquet")
        polars.DataFrame(named).write_parquet(path)
    elif kind == "npz":
        path = path.with_suffix(".npz")
        np.savez_compressed(path, **named)
    elif kind == "npy":
        path = path.with_suffix(".npy")
        np.save(path, np.column_stack(list(named.values())))
        columns = {"q": [str(k) for k in range(2, 8)], "tau": [str(k) for k in range(8, 14)]}
    elif kind == "mat 7.3":
        path = path.with_suffix(".mat")
        with h5py.File(path, "w", userblock_size=512) as archive:
            for name, x in {"t": t[:, None], "q": q, "tau": tau}.items():
                archive.create_dataset(name, data=x.T, compression="gzip").attrs["MATLAB_class"] = (
                    np.bytes_("double")
                )
        columns = {"q": ["q"], "tau": ["tau"]}
    elif kind.startswith("mat"):
        path = path.with_suffix(".mat")
        scipy.io.savemat(
            path, {"t": t[:, None], "q": q, "tau": tau}, do_compression=kind.endswith("7")
        )
        columns = {"q": ["q"], "tau": ["tau"]}
    else:
        stamps = START + np.rint(t * 1e9).astype(np.int64)
        path = write_bag(kind, path, {"/tx40/joint_states": joint_states(stamps, JOINTS, q, tau)})
        columns = {"q": JOINTS, "tau": JOINTS}
    return path, columns


def estimates(model, path, columns, rate, *, stamps):
    """Estimates of all and of the essential parameters; from the time stamps, or at the rate that
    the study declares.
    """
    time = (
        {"columns": {**columns, "t": "1" if path.suffix == ".npy" else "t"}}
        if stamps
        else {"columns": columns, "rate": rate}
    )
    study = study_from_mapping(
        {**dataset_study("tx40"), "record": {"files": str(path), "side": "motor", **time}}
    )
    (record,) = read_records(study.record, model)
    found = essential_of(
        linear_system(observe(model, record, study), study.estimate),
        study.essential,
        model=model,
    )
    return found.all_parameters, found.estimate


def bits(estimate):
    """All that an Estimate says, down to the last digit, the names and hashes of its files aside."""
    said = json.loads(estimate.to_json())
    del said["provenance"]
    return said


def measured():
    """Motor positions and torques of the TX40."""
    paths = [fetch("tx40", name) for name in ("pos_read_data.csv", "curr_data.csv")]
    q, tau = (np.loadtxt(path, delimiter=",", skiprows=1, usecols=range(6)) for path in paths)
    return q, tau


@pytest.fixture(scope="module")
def tx40(tx40_data):
    q, tau = measured()
    rate = 5000 / KEEP
    return (
        load_model(Path(__file__).parents[2] / "generated" / "tx40.py"),
        rate,
        q[::KEEP],
        tau[::KEEP],
    )


@pytest.fixture(scope="module")
def reference(tx40, tmp_path_factory):
    model, rate, q, tau = tx40
    path, columns = write(
        "npz", tmp_path_factory.mktemp("reference"), np.arange(len(q)) / rate, q, tau
    )
    return estimates(model, path, columns, rate, stamps=False)


@pytest.mark.parametrize("kind", sampled(FORMATS, 0, always=("csv.gz", "mcap")))
def test_every_format_gives_the_same_estimate(tx40, reference, tmp_path, kind):
    model, rate, q, tau = tx40
    path, columns = write(kind, tmp_path, np.arange(len(q)) / rate, q, tau)
    declared = estimates(model, path, columns, rate, stamps=False)
    assert [bits(x) for x in declared] == [bits(x) for x in reference]
    stamped = estimates(model, path, columns, rate, stamps=True)
    for one, other in zip(stamped, reference, strict=True):
        assert one.names == other.names
        np.testing.assert_allclose(one.X, other.X, rtol=1e-9, atol=1e-9 * np.abs(other.X).max())
        np.testing.assert_allclose(one.sigma, other.sigma, rtol=1e-9)


def whole_record(folder):
    """All 45000 samples: whether the bits are those of the dataset, and the largest difference from
    the time stamps.
    """
    model = load_model(Path(__file__).parents[2] / "generated" / "tx40.py")
    q, tau = measured()
    (record,) = read_records(study_from_mapping(dataset_study("tx40")).record, model)
    study = study_from_mapping(dataset_study("tx40"))
    found = essential_of(
        linear_system(observe(model, record, study), study.estimate),
        study.essential,
        model=model,
    )
    expected = [found.all_parameters, found.estimate]
    for kind in FORMATS:
        path, columns = write(kind, folder, np.arange(len(q)) / 5000, q, tau)
        declared = estimates(model, path, columns, 5000, stamps=False)
        stamped = estimates(model, path, columns, 5000, stamps=True)
        difference = max(
            np.abs(one.X / other.X - 1).max() for one, other in zip(stamped, expected, strict=True)
        )
        print(
            f"{kind:10} same bits: {[bits(x) for x in declared] == [bits(x) for x in expected]}, "
            f"from time stamps {difference:.1e}"
        )


if __name__ == "__main__":
    whole_record(Path(sys.argv[1]))
