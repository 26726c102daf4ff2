"""A study whose records can be read: what refuses to read them says what would cure it, and that is
put into the study, until nothing refuses.

    study, sentences = suggested(study, model)
"""

from __future__ import annotations

from collections.abc import Mapping

from runtime.core.errors import InputError
from runtime.core.model import GeneratedModel
from runtime.core.study import Study, study_from_mapping, to_mapping
from runtime.reading.records import read_records
from runtime.yaml_text import yaml_text


def suggested(study: Study, model: GeneratedModel) -> tuple[Study, list[str]]:
    """The study with the remedy of each refusal in its records, and a sentence on each. Remedies are likely, by names and time stamps, not known: a person looks at them.

    Raises
    ------
    InputError
        A refusal that has no remedy, or whose remedy does not help.
    """
    sentences: list[str] = []
    while True:
        try:
            read_records(study.record, model, missing=study.signals.admits_missing)
        except InputError as e:
            text = f"{e}; suggested: record: {' '.join(yaml_text(e.remedy or {}).split())}"
            if not e.remedy or text in sentences:
                raise
            sentences.append(text)
            mapping = to_mapping(study)
            for record in mapping["record"]:
                for key, value in e.remedy.items():
                    if isinstance(value, Mapping):
                        value = {**(record[key] or {}), **value}
                    record[key] = value
            study = study_from_mapping(mapping)
        else:
            return study, sentences
