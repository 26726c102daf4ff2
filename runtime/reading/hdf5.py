"""Reading of HDF5 files (.h5, .hdf5), by h5py (pip install symgen[tables]).

A data set in groups has the name observations.qpos. Vectors and matrices of numbers are read;
images and other arrays of more dimensions are not. A file that MATLAB wrote is read by
`runtime.reading.mat`.

Groups that differ by a number, such as data/demo_0, data/demo_1 ... of robomimic, are episodes: their
data sets, one after the other, are the columns data.demo.obs.joint_pos, and each episode is a record of
its own. data.demo_0.obs.joint_pos is the data set of one episode.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import require_size, unpacked
from runtime.reading.mat import read_mat
from runtime.reading.table import WIDEST, Array, Options, Table, damage_named, is_numeric

TITLE = "an HDF5 file"
DEEPEST = 8  # groups in one another
NUMBERED = re.compile(r"(.*?)[_-]?(\d+)")  # name of a group
EPISODE = re.compile(
    r"(?i)demo(nstration)?|ep(isode)?|traj(ectory)?|rollout|run|trial|take|seq(uence)?|rec(ord(ing)?)?"
)


def read_hdf5(path: Path, options: Options) -> Table:
    """Read the vectors and matrices of an HDF5 file as a Table of named columns."""
    import h5py

    columns: dict[str, Array] = {}
    others: dict[str, str] = {}
    with damage_named(TITLE, path.name), h5py.File(unpacked(path), "r") as archive:
        by_matlab = any("MATLAB_class" in x.attrs for x in archive.values())
        if not by_matlab:
            sizes: list[int] = []
            _collect("", archive, columns, others, sizes, path)
    if by_matlab:
        return read_mat(path, options)
    refused = {
        name: InputError(
            f"{what}; expected numbers of shape (N,) or (N, k)", file=path.name, column=name
        )
        for name, what in others.items()
    }
    return _by_episodes(Table(file=path.name, columns=columns, refused=refused))


@dataclass(frozen=True, eq=False, kw_only=True)
class EpisodeTable(Table):
    """Table of a file with episodes; `columns` are those of all episodes together.

    Attributes
    ----------
    single : mapping of str to ndarray
        Columns of single episodes, which a study may name.
    joined : frozenset of str
        Names of the columns of all episodes.
    """

    single: Mapping[str, Array]
    joined: frozenset[str]

    def chosen(self, names: Sequence[str]) -> Table:
        """Return a table of the named columns, with the starts of the episodes if the columns are
        those of all episodes.
        """
        own = {name: self.single[name] for name in names if name in self.single}
        starts = self.starts if self.joined.intersection(names) else ()
        return Table(
            file=self.file,
            columns={**self.columns, **own},
            refused=self.refused,
            note=f"{len(starts) + 1} episodes" if starts else "",
            digest=self.digest,
            starts=starts,
        )


def _by_episodes(table: Table) -> Table:
    """Join the data sets of groups that are episodes; without episodes, return the table unchanged."""
    found: dict[tuple[str, str], dict[int, dict[str, str]]] = {}
    for name in table.columns:
        parts = name.split(".")
        for k, part in enumerate(parts[:-1]):
            if match := NUMBERED.fullmatch(part):
                episodes = found.setdefault((".".join(parts[:k]), match[1]), {})
                episodes.setdefault(int(match[2]), {})[".".join(parts[k + 1 :])] = name
                break
    for (prefix, stem), episodes in found.items():
        names = [episodes[number] for number in sorted(episodes)]
        lengths = _lengths(table, names, stem)
        if not lengths:
            continue
        joined = {}
        for rest in names[0]:
            several = [table.columns[one[rest]] for one in names]
            own = [len(x) if x.ndim else 0 for x in several]
            if own == lengths and len({x.shape[1:] for x in several}) == 1:
                joined[".".join(filter(None, (prefix, stem, rest)))] = np.concatenate(several)
        single = {name: table.columns[name] for one in names for name in one.values()}
        others = {name: x for name, x in table.columns.items() if name not in single}
        return EpisodeTable(
            file=table.file,
            columns={**others, **joined},
            refused=table.refused,
            starts=tuple(int(start) for start in np.cumsum(lengths)[:-1]),
            single=single,
            joined=frozenset(joined),
        )
    return table


def _lengths(table: Table, names: Sequence[Mapping[str, str]], stem: str) -> list[int]:
    """Return the numbers of samples of groups that are episodes, or an empty list if the groups are
    no episodes.

    Groups of the same length are episodes only if their name says so, because the groups may be
    joints.
    """
    if len(names) < 2 or len({frozenset(one) for one in names}) > 1:
        return []
    lengths = []
    for one in names:
        sizes = Counter(len(table.columns[x]) for x in one.values() if table.columns[x].ndim)
        if not sizes:
            return []
        lengths.append(sizes.most_common(1)[0][0])
    alike = len({*lengths}) == 1
    return [] if alike and not EPISODE.fullmatch(stem) else lengths


def _collect(
    prefix: str,
    group: Any,
    columns: dict[str, Array],
    others: dict[str, str],
    sizes: list[int],
    path: Path,
    depth: int = 0,
) -> None:
    """Read the data sets of a group and of the groups in it; links to other files are refused."""
    import h5py

    for key in group:
        name = f"{prefix}{key}"
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            others[name] = "a link"
            continue
        x = group[key]
        if isinstance(x, h5py.Group):
            if depth < DEEPEST:
                _collect(f"{name}.", x, columns, others, sizes, path, depth + 1)
        elif not isinstance(x, h5py.Dataset) or not is_numeric(x):
            others[name] = f"values of {getattr(x, 'dtype', 'another kind')}"
        elif x.external is not None or x.is_virtual:
            others[name] = "stored in another file"
        elif x.shape is None or x.ndim > 2 or (x.ndim == 2 and min(x.shape) > WIDEST):
            others[name] = f"an array of shape {x.shape}"
        else:
            sizes.append(x.size * x.dtype.itemsize)
            require_size(sum(sizes), path.stat().st_size, path.name)
            columns[name] = np.asarray(x[()])
