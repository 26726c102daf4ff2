"""Many records at once, on a Dask cluster (pip install distributed): a record that cannot be read has its reason in the table and the others go on. Then the runs of one resolution study, on the same cluster."""

import tempfile
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster

import runtime
import symgen
from runtime.core.errors import InputError


def identified(file: Path) -> str:
    """One line of the table. A worker runs it."""
    try:
        model = symgen.model("planar_2r")
        result = runtime.identify(model, runtime.read_record(file, model))
    except InputError as error:
        return f"{file.stem}: failed. {error}"
    return f"{file.stem}: {result.model_estimate.relative_error:.1f} %, {result.checklist.answer}"


def simulated(folder: Path) -> list[Path]:
    """Files of three arms that carry different tools, and the name of one that does not exist."""
    model = symgen.model("planar_2r")
    t = np.arange(0, 20, 0.005)
    w = np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]])
    a = np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]])
    phase = t[:, None, None] * w
    q = (a * np.sin(phase)).sum(axis=1)
    qd = (a * w * np.cos(phase)).sum(axis=1)
    qdd = (-a * w**2 * np.sin(phase)).sum(axis=1)
    for number, mass in enumerate((2.0, 2.5, 3.0)):
        X = model.base_parameters({**model.VALUES, "M2": mass})
        noise = np.random.default_rng(number).normal(0, 0.2, q.shape)
        columns = np.column_stack([t, q, model.inverse_dynamics(q, qd, qdd, X) + noise])
        header = "t,q1,q2,tau1,tau2"
        np.savetxt(folder / f"arm{number}.csv", columns, delimiter=",", header=header, comments="")
    return [folder / f"arm{number}.csv" for number in range(4)]


if __name__ == "__main__":
    files = simulated(Path(tempfile.mkdtemp()))
    with (  # of other machines: Client("tcp://10.0.0.1:8786") alone
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):

        def on_cluster(function, keys):
            return (future.result() for future in client.map(function, keys))

        print(*on_cluster(identified, files), sep="\n")
        model = symgen.model("planar_2r")
        study = runtime.Study(cestac={"delta": [1e-4, 1e-3], "runs": 20})
        record = runtime.read_record(files[0], model)
        print(runtime.cestac(model, record, study, map=on_cluster).message)
