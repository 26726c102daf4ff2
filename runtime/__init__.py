"""From a measured record to parameters: numpy and scipy only.

    model = load_model("tx40")
    study = load_study(path)                        # runtime.io.study_files
    record = read_records(study.record, model)[0]
    observation = observe(model, record, study)     # Y = W X + rho, eqs. (6) and (14)

Estimators take an Observation and return an Estimate (`runtime.estimators`).
"""

from runtime.drives import Drives
from runtime.errors import DataUnavailableError, InputError, ModelError, SettingsError
from runtime.io.records import read_record, read_records
from runtime.model import GeneratedModel, load_model
from runtime.observation import Observation, observe, stack
from runtime.record import Record
from runtime.signals import States, filtered_states
from runtime.study import Study, study_from_mapping, to_mapping

__all__ = [
    "DataUnavailableError",
    "Drives",
    "GeneratedModel",
    "InputError",
    "ModelError",
    "Observation",
    "Record",
    "SettingsError",
    "States",
    "Study",
    "filtered_states",
    "load_model",
    "observe",
    "read_record",
    "read_records",
    "stack",
    "study_from_mapping",
    "to_mapping",
]
