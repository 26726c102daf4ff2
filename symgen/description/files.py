"""Read and write robots: packaged robots, robot files (.yaml), SYMORO .par, URDF and MJCF files.

The suffix of the file selects the format. Robot files and URDF can be written.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from symgen.description.angles import NotReadWarning
from symgen.description.fields import located
from symgen.description.par import read_par
from symgen.description.robot import INERTIAL, Robot, parameter
from symgen.description.yaml import parse_robot, write_yaml
from symgen.errors import DescriptionError, require

LOOPS_ENDING = ".loops.yaml"
TREES = (".urdf", ".xml", ".mjcf")  # suffixes of the formats of links and joints by name
BASES = ("fixed", "moving", "free")
WRITTEN = (".yaml", ".yml", ".urdf")  # suffixes of the formats that are written
MAX_BYTES = 10_000_000  # no format reads more; each has a limit of its own below


UNREAD = {
    ".xacro": "xacro is a template; expand it first: xacro FILE -o arm.urdf",
    ".sdf": "SDF is not read; convert it to a URDF or an MJCF",
}


def packaged_robots() -> tuple[str, ...]:
    """List the names of the packaged robots, which `load_robot` accepts in place of a path.

    Examples
    --------
    >>> import symgen
    >>> "tx40" in symgen.packaged_robots()
    True
    """
    folder = resources.files("symgen.description") / "robots"
    return tuple(
        sorted(
            entry.name.removesuffix(".yaml")
            for entry in folder.iterdir()
            if entry.name.endswith(".yaml")
        )
    )


def load_robot(
    source: str | Path, *, keep_fixed: bool = False, exact: bool = False, base: str | None = None
) -> Robot:
    """Read a robot file, or a packaged robot by its name.

    Parameters
    ----------
    source : str or Path
        Name of a packaged robot (`tx40`), or path of a robot file (`arm.yaml`, `./tx40`), a `.par`
        file, a URDF (`.urdf`) or an MJCF (`.xml`, `.mjcf`; extra `mjcf`).
    keep_fixed : bool
        For a URDF or MJCF: whether links on fixed joints become fixed frames of their own, as in
        `read_tree`.
    exact : bool
        For a URDF, MJCF or `.par` file: whether angles stay as written, which a calibrated robot
        needs. Otherwise, an angle within 1e-4 rad of a multiple of pi/12 becomes this multiple, and
        an AngleWarning names the largest change, if it exceeds 1e-9 rad.
    base : str, optional
        `moving`: frame 0 is a body whose motion is measured; `free`: the wrench on this body is
        measured too; `fixed`: frame 0 stands still. Default: the base of the file.

    Returns
    -------
    Robot
        The checked, immutable robot. A NotReadWarning names the parts of the file that change the
        torques and are not in the equations, such as closed loops of a URDF (`Robot.not_read`).

    Raises
    ------
    DescriptionError
        The file cannot be read or describes no robot; the message names file and line.

    Examples
    --------
    >>> import symgen
    >>> robot = symgen.load_robot("tx40")
    >>> robot.title
    'Stäubli TX40, 6 revolute joints'
    >>> len(robot.joints), len(robot.parameters)
    (6, 86)
    """
    return on_base(read_robot(source, keep_fixed=keep_fixed, exact=exact)[0], base)


def robot_of(robot: str | Path | Robot) -> Robot:
    """Return a Robot as it is, or load a packaged robot by name, or a robot file.

    Parameters
    ----------
    robot : str, Path or Robot
        Name of a packaged robot, path of a robot file (.yaml, .par, .urdf, MJCF), or a Robot.

    Raises
    ------
    DescriptionError
        As in `load_robot`; also if `robot` is of another type.
    """
    return robot if isinstance(robot, Robot) else load_robot(robot)


def on_base(robot: Robot, base: str | None) -> Robot:
    """Return the robot with a fixed, moving or free base; None keeps the base of the file."""
    if base is None:
        return robot
    if not isinstance(base, str) or base not in BASES:
        shown = repr(base) if isinstance(base, str) else f"a {type(base).__name__}"
        expected = f"{', '.join(BASES[:-1])} or {BASES[-1]}"
        raise DescriptionError(f"base is {shown:.40}; expected {expected}")
    values = dict(robot.values)
    if base == "free":
        values = {**robot.of_base, **values}
    elif robot.base_is_free:
        values = {k: x for k, x in values.items() if k not in [parameter(p, 0) for p in INERTIAL]}
    return replace(robot, base=base, values=values)  # type: ignore[arg-type]  # checked


def read_robot(
    source: str | Path,
    *,
    constants: Mapping[str, float] | None = None,
    exact: bool = False,
    keep_fixed: bool = False,
    lock: Mapping[str, float] | None = None,
    chain: tuple[str, str] | None = None,
) -> tuple[Robot, tuple[str, ...]]:
    """Read a robot file; return the Robot, and notes on data that were changed or left out.

    Parameters
    ----------
    source, keep_fixed, exact
        As in `load_robot`.
    constants : mapping, SI and rad
        Values of the symbols of a `.par` file, because this format has no field for them.
    lock : mapping, rad or m
        For a URDF or MJCF: positions at which joints are held, by joint name.
    chain : tuple of str
        For a URDF or MJCF: names of a base link and a tip link. Only the joints between these links
        move; all others are held at zero.

    Raises
    ------
    DescriptionError
        As in `load_robot`; also if `lock` or `chain` is given for another format, or names a joint
        or link that the file does not have.
    """
    robot, notes = _read(source, constants, exact, keep_fixed, lock, chain)
    warn_not_read(robot)
    return robot, notes


def warn_not_read(robot: Robot) -> None:
    """Warn of the parts of the robot's file that change the torques and are not in the equations."""
    if robot.not_read:
        warnings.warn(not_read_text(robot), NotReadWarning, stacklevel=4)


def not_read_text(robot: Robot) -> str:
    """Name the parts of the robot's file that are not in the equations; "" if there are none."""
    parts = "; ".join(robot.not_read)
    return f"{robot.file}: not read, hence not in the equations: {parts}" if parts else ""


def _read(
    source: str | Path,
    constants: Mapping[str, float] | None,
    exact: bool,
    keep_fixed: bool,
    lock: Mapping[str, float] | None,
    chain: tuple[str, str] | None,
) -> tuple[Robot, tuple[str, ...]]:
    """Read a robot file in the format of its suffix, without the warning of `read_robot`."""
    if not isinstance(source, str | Path):
        raise DescriptionError(
            f"robot is a {type(source).__name__}; expected the name of a packaged robot, the path of "
            "a robot file, or a Robot"
        )
    require(exact, bool, "exact", "True or False")
    require(keep_fixed, bool, "keep_fixed", "True or False")
    require(lock, (Mapping, type(None)), "lock", "{joint name: position}")
    require(chain, (tuple, list, type(None)), "chain", "the names of a base link and a tip link")
    suffix = "" if source in packaged_robots() else Path(source).suffix.lower()
    if (lock or chain) and suffix not in TREES:
        raise DescriptionError(
            f"{source}: lock and chain are only for files {', '.join(TREES)}; edit the frames of this "
            "file instead"
        )
    if source in packaged_robots():
        file = f"{source}.yaml"
        return parse_robot(
            (resources.files("symgen.description") / "robots" / file).read_bytes(), file
        ), ()
    path = Path(source)
    if suffix in UNREAD:
        raise DescriptionError(f"{path.name}: {UNREAD[suffix]}")
    content = content_of(path)
    if suffix == ".par":
        return read_par(content, path.name, constants, exact=exact)
    if suffix in TREES[1:] and b"<include" in content:
        from symgen.description.mjcf import with_includes

        with located(path.name):
            content = with_includes(content, _beside(path))
    if suffix in TREES:
        from symgen.description.tree import TreePart  # numpy, which robot files do without
        from symgen.description.tree_robot import read_tree

        part = TreePart(lock or {}, chain)
        beside = loops_beside(path)
        return read_tree(
            content, path.name, exact=exact, keep_fixed=keep_fixed, part=part, loops=beside
        )
    return parse_robot(content, path.name), ()


def _beside(path: Path) -> Callable[[str, int], bytes]:
    """Make a function that reads the files which the MJCF file `path` includes.

    Each file may be included once, and must lie in the folder of `path` or below.
    """
    folder, before = path.resolve().parent, {path.resolve()}

    def read(name: str, line: int) -> bytes:
        included = (folder / name).resolve()
        problems = (
            (
                not included.is_relative_to(folder),
                "the included file is outside the folder of the MJCF file; copy it into this folder",
            ),
            (included in before, "a file may be included once, and never by itself"),
            (not os.path.isfile(included), "no such file"),  # noqa: PTH113 (of any length)
        )
        for wrong, what in problems:
            if wrong:
                raise DescriptionError(f"<include file={name[:100]!r}>: {what}", line=line)
        before.add(included)
        return content_of(included)

    return read


def is_loops_file(name: str) -> bool:
    """Whether a file of this name has the loops of a URDF or MJCF beside it."""
    from symgen.description.loops_file import EXPORTED  # numpy

    return name.lower().endswith((LOOPS_ENDING, EXPORTED))


def loops_beside(path: Path) -> Any:
    """Return the LoopsText of the file with the loops of a URDF or MJCF, or None if there is none.

    The file is NAME.loops.yaml or loop_closures.yaml in the same folder. For a robot file in a
    folder `urdf`, it may also be in the parent folder, or in the folder `config` of that folder.
    """
    from symgen.description.loops_file import EXPORTED, LoopsText  # numpy

    folders = [path.parent]
    if path.resolve().parent.name == "urdf":
        above = path.resolve().parent.parent
        folders += [above, above / "config"]
    places = [path.with_suffix(LOOPS_ENDING), *(folder / EXPORTED for folder in folders)]
    found = next((place for place in places if place.is_file()), None)
    return None if found is None else LoopsText(found.name, content_of(found))


def write_robot(
    robot: Robot, file: str, *, comments: Sequence[str] = ()
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a file that describes `robot`, in the format that the suffix of `file`
    selects, and notes.

    The notes list the data of the robot that the format cannot store. No file is written.

    Parameters
    ----------
    robot : Robot
        The robot to be written.
    file : str
        Name of the file, with the suffix .yaml, .yml or .urdf.
    comments : sequence of str
        Comment lines at the top of a robot file (.yaml).

    Raises
    ------
    DescriptionError
        The suffix is unknown, or the format cannot represent this mechanism.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in WRITTEN:
        raise DescriptionError(f"{file}: expected a file name that ends in {', '.join(WRITTEN)}")
    if suffix == ".urdf":
        from symgen.description.urdf import write_urdf  # numpy, which robot files do without

        return write_urdf(robot)
    return write_yaml(robot, comments=comments), ()


def content_of(path: Path) -> bytes:
    """Return the content of a robot file as bytes, cut off just above the largest allowed size.

    Raises DescriptionError if the file cannot be read.
    """
    names, shown = ", ".join(packaged_robots()), str(path).replace("\n", "\\n")
    try:
        if path.exists() and not path.is_file():  # a pipe may never answer, a device never end
            raise OSError(0, "the path is a folder, a pipe or a device")
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        raise DescriptionError(
            f"no file {shown} and no packaged robot of that name; packaged are {names}",
            file=path.name,
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DescriptionError(
            f"cannot read {shown}: {reason}; expected a robot file or one of {names}",
            file=path.name or shown,  # the folder . has no name
        ) from error
