"""Semidefinite programs of one `identify`: each at most once, and only for the set that is printed."""

from dataclasses import replace

import numpy as np
import pytest

import runtime
import symgen
from runtime.core.study import EssentialSettings
from runtime.physical.semidefinite import Program
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping


@pytest.fixture
def programs(monkeypatch) -> list[bytes]:
    """The numbers of every program that was solved."""
    solved: list[bytes] = []
    solve = Program.solve

    def counted(self):
        parts = [self.linear, self.diagonal, self.squares]
        parts += [array for _, *arrays in self.constraints for array in arrays]
        solved.append(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
        return solve(self)

    monkeypatch.setattr(Program, "solve", counted)
    return solved


def test_no_program_where_the_essential_parameters_are_printed(tx40_data, programs) -> None:
    """The packaged study of the TX40 lets them stand first; 68 programs before."""
    model = symgen.model("tx40")
    study = study_from_mapping(dataset_study("tx40"))
    result = runtime.identify(model, read_records(study.record, model), study)
    assert result.model_columns == "essential" and str(result)
    assert programs == []
    assert result.whole_estimate.method == "feasible" and len(programs) > 0


def test_each_program_once_where_the_physical_parameters_are_printed(programs) -> None:
    """The search for the weight of the prior, the fit, what stands in the way of least squares, and
    one fit of a half of the record.
    """
    model = symgen.model("planar_2r")
    rng = np.random.default_rng(0)
    t = np.arange(1600) / 200
    w = 2 * np.pi * np.array([0.3, 0.7])
    q = np.stack([0.8 * np.sin(w[0] * t), 0.9 * np.sin(w[1] * t + 1)], axis=1)
    qd = np.gradient(q, t, axis=0)
    qdd = np.gradient(qd, t, axis=0)
    X = model.base_parameters(model.VALUES)
    tau = model.inverse_dynamics(q, qd, qdd, X) + 0.05 * rng.standard_normal(q.shape)
    record = runtime.Record(t, q, tau)
    study = runtime.Study(signals={"lowpass": {"cutoff": 10}})
    result = runtime.identify(model, record, study)
    assert result.model_columns == "feasible"
    assert len(set(programs)) == len(programs) <= 5 * 11 + 6
    programs.clear()
    first = replace(study, essential=EssentialSettings(first=True))
    chapter = runtime.identify(model, record, first)
    assert chapter.model_columns == "essential" and programs == []
