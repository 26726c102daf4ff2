"""From a measured record to parameters: numpy and scipy only.

    model = load_model("tx40")
    study = load_study(path)                        # runtime.settings.files
    record = read_records(study.record, model)[0]
    observation = observe(model, record, study)     # Y = W X + rho, eqs. (6) and (14)

    streams = open_streams(study.record, model, block=65536)
    reduction = reduce_records(model, streams, study)       # the same for records larger than memory: factors instead of rows

Estimators take an Observation or a Reduction and return an Estimate (`runtime.estimators`). On states without filters,
`normal_equations` and `triangular_factor` solve by blocks, without W.
"""

from runtime.errors import DataUnavailableError, InputError, ModelError, SettingsError
from runtime.estimators.reductions import normal_equations, triangular_factor
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, load_model
from runtime.observation.by_blocks import reduce_records
from runtime.observation.filters import States, filtered_states
from runtime.observation.observation import Observation, observe, stack
from runtime.observation.reduction import Reduction
from runtime.records.reading import read_record, read_records
from runtime.records.reading_by_blocks import open_streams
from runtime.records.record import Record
from runtime.settings.study import Study, study_from_mapping, to_mapping

__all__ = [
    "DataUnavailableError",
    "Drives",
    "GeneratedModel",
    "InputError",
    "ModelError",
    "Observation",
    "Record",
    "Reduction",
    "SettingsError",
    "States",
    "Study",
    "filtered_states",
    "load_model",
    "normal_equations",
    "observe",
    "open_streams",
    "read_record",
    "read_records",
    "reduce_records",
    "stack",
    "study_from_mapping",
    "to_mapping",
    "triangular_factor",
]
