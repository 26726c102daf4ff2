"""Looking up public records: SYMGEN_DATA, the cache, the source; no test here reaches the network."""

import gzip
import hashlib

import pooch
import pytest

from runtime.ground.errors import DataUnavailableError, InputError
from runtime.reading import datasets
from runtime.reading.datasets import DATASETS, Dataset, dataset_study, fetch, locate
from runtime.study import study_from_mapping

CONTENT = b"q1,tau1\n1,2\n"


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """A dataset of one file whose source is a folder of this machine."""
    source = tmp_path / "source"
    source.mkdir()
    toy = Dataset(
        "Toy",
        "here",
        "none",
        f"{source.as_uri()}/",
        {"a.csv": hashlib.sha256(CONTENT).hexdigest()},
        {"record": {"files": ["a.csv"]}},
    )
    monkeypatch.setattr(datasets, "DATASETS", {"toy": toy})
    monkeypatch.delenv("SYMGEN_DATA", raising=False)

    def copy(url, output, _pooch):
        from urllib.request import url2pathname

        path = url2pathname(url.removeprefix("file:"))
        with open(path, "rb") as f, open(output, "wb") if isinstance(output, str) else output as g:  # noqa: PTH123
            g.write(f.read())

    monkeypatch.setattr(pooch, "HTTPDownloader", lambda **options: copy)
    return source


@pytest.mark.parametrize("packed", [False, True])
def test_folder_of_the_user_comes_first(toy, monkeypatch, tmp_path, packed):
    folder = tmp_path / "data" / "toy"
    folder.mkdir(parents=True)
    path = folder / ("a.csv.gz" if packed else "a.csv")
    path.write_bytes(gzip.compress(CONTENT) if packed else CONTENT)
    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path / "data"))
    assert (
        fetch("toy", "a.csv", cache=tmp_path / "cache")
        == path
        == locate("toy", "a.csv", cache=tmp_path / "cache")
    )
    assert [p.name for p in folder.iterdir()] == [path.name] and not (tmp_path / "cache").exists()


def test_another_file_under_that_name_is_an_error(toy, monkeypatch, tmp_path):
    (tmp_path / "data" / "toy").mkdir(parents=True)
    (tmp_path / "data" / "toy" / "a.csv").write_bytes(b"other")
    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path / "data"))
    with pytest.raises(InputError, match="the hash of the public record"):
        fetch("toy", "a.csv", cache=tmp_path / "cache")


def test_source_then_cache(toy, tmp_path):
    (toy / "a.csv").write_bytes(CONTENT)
    assert locate("toy", "a.csv", cache=tmp_path / "cache") is None
    path = fetch("toy", "a.csv", cache=tmp_path / "cache")
    assert path.read_bytes() == CONTENT
    (toy / "a.csv").unlink()
    assert fetch("toy", "a.csv", cache=tmp_path / "cache") == path


def test_nowhere(toy, monkeypatch, tmp_path):
    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path / "empty"))
    with pytest.raises(DataUnavailableError) as e:
        fetch("toy", "a.csv", cache=tmp_path / "cache")
    assert len(e.value.tried) == 3
    for said in (
        "SYMGEN_DATA=",
        "cache",
        "download of",
        "set the environment variable SYMGEN_DATA",
    ):
        assert said in str(e.value)


def test_download_with_another_hash(toy, tmp_path):
    (toy / "a.csv").write_bytes(b"other")
    with pytest.raises(DataUnavailableError, match="download of"):
        fetch("toy", "a.csv", cache=tmp_path / "cache")
    assert locate("toy", "a.csv", cache=tmp_path / "cache") is None


def test_unknown_names():
    with pytest.raises(InputError, match="expected one of tx40, emps"):
        fetch("rx90", "a.csv")
    with pytest.raises(InputError, match=r"its files are pos_read_data\.csv, curr_data\.csv"):
        fetch("tx40", "a.csv")


def test_settings_are_a_copy():
    dataset_study("emps")["signals"]["median"] = 99
    assert dataset_study("emps")["signals"]["median"] == 1


@pytest.mark.parametrize("name", DATASETS)
def test_settings_name_the_files(name):
    study = study_from_mapping(dataset_study(name))
    for record in study.record + study.validate.record:
        assert record.dataset == name and set(record.files) <= set(DATASETS[name].files)


def test_settings_of_the_tx40_are_those_of_the_chapter():
    study = study_from_mapping(dataset_study("tx40"))
    assert study.record[0].side == "motor" and study.record[0].rate == 5000
    assert (
        study.signals.lowpass.cutoff,
        study.signals.lowpass.order,
        study.signals.decimate.factor,
    ) == (50, 4, "auto")
    assert study.rows.window == (0, 7.5)
