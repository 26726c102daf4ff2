"""The MATLAB files of a robot: one function file for each model, also for Octave.

States stand in rows, q (N, n), and every line computes all N samples. Constants of the robot file
are one row, or one row for each sample. A result has the samples first: D (N, n, b), so that
reshape(D, [], b) is the observation matrix W with rows joint-major.

The texts use only the language that MATLAB and Octave share.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap
from typing import NamedTuple

from symgen.derive.graph import SYM
from symgen.derive.models import MODELS
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.robot import FIXED, PRISMATIC
from symgen.emit.blocks import Block, FunctionPrinter, aligned
from symgen.emit.header import BASE_MOTION, header, plain
from symgen.emit.printers import Language, Section
from symgen.emit.python_target import tuple_of
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import BASE, ModuleSpec
from symgen.errors import SymgenError
from symgen.regroup.regrouping import sign_conditions
from symgen.version import VERSION

LONGEST = 63  # characters of a name in MATLAB
KEYWORDS = """break case catch classdef continue else elseif end for function global if otherwise
parfor persistent return spmd switch try while
do until unwind_protect unwind_protect_cleanup end_try_catch end_unwind_protect endclassdef endfor
endenumeration endevents endfunction endif endmethods endparfor endproperties endspmd endswitch
endwhile enumeration events methods properties"""
FUNCTIONS_READ = """cos sin realsqrt realpow sign exp tanh max min abs isnan zeros size numel reshape any isempty
isequal isscalar error nargin nargout pi"""
OWN = """base constants N above below j k t joint column poses axis arm twist rate antecedent slides
standard"""
RESERVED = frozenset(f"{KEYWORDS} {FUNCTIONS_READ} {OWN}".split())
CALLS = {"sqrt": "realsqrt", "pow": "realpow"}  # an error where sqrt is complex
LICENCE = "SPDX-License-Identifier: BSD-3-Clause"
STATES = ("base", "q", "qd", "qdd", "qdr", "qddr", "tau")
"""Arguments that vary from sample to sample."""
MOTION = 9
"""Columns of the motion of a base."""
MODEL = "model"
"""Function with the names and values of parameters, constants and joints."""
HELPERS = ("above", "below")


def is_word(name: str) -> bool:
    """Whether a name is a word of MATLAB or Octave, or is used by the code around the lines."""
    return name in RESERVED


MATLAB = Language(
    {op: CALLS.get(op, op) for op in FUNCTIONS},
    "above({})",
    "below({})",
    "pi",
    square="{0}.^2",
    times=".*",
    over="./",
    power=".^",
    comment="%",
    prose=("\0", "\0"),  # it has comments alone
    breaks=True,
    continues=" ...",
    step="{} = {};",
    entry="{} = {};",
    chained=False,
    is_word=is_word,
)


class File(NamedTuple):
    """One function file, before the template writes it.

    Attributes
    ----------
    name : str
        Name of the function without that of the robot, such as regressor.
    results : tuple of str
        Names of the results.
    arguments : tuple of str
        Names of the arguments.
    about : tuple of str
        Lines of the help text.
    sections : tuple of Section
        Lines of the body, under headings.
    """

    name: str
    results: tuple[str, ...]
    arguments: tuple[str, ...]
    about: tuple[str, ...]
    sections: tuple[Section, ...]


def render(spec: ModuleSpec, *, command: str | None = None) -> dict[str, str]:
    """Return the text of each function file of a robot, by the name of the function.

    The same robot file and the same version give the same bytes.
    """
    return _Robot(spec, command).texts()


class _Robot:
    """The function files of one robot."""

    def __init__(self, spec: ModuleSpec, command: str | None) -> None:
        self.spec, self.robot = spec, spec.robot
        self.command = command or spec.robot.file or spec.robot.name
        self.names = spec.names(is_word)
        self.free = tuple(spec.regrouping.constants)
        self.n, self.b = len(self.robot.joints), len(spec.regrouping)

    def texts(self) -> dict[str, str]:
        blocks = {
            name: FunctionPrinter(self.spec, [f], self.names.inner(), MATLAB, _inputs).block(f)
            for name, f in self.spec.functions.items()
        }
        files = [self._base_parameters(), *map(self._of_block, blocks.values()), self._jacobian()]
        if not self.robot.loaded:
            files.append(self._forward_dynamics())
        if self.robot.passive:
            files.append(self._passive_joints())
        files.append(self._model(blocks))
        return {file.name: self._laid_out(file) for file in files}

    def _laid_out(self, file: File) -> str:
        robot, function = self.robot, f"{self.robot.name}_{file.name}"
        lines = [line for section in file.sections for line in section.lines]
        read = {word for line in lines for word in re.findall(r"[A-Za-z]\w*", line)}
        longest = max((function, *read), key=len)
        if len(longest) > LONGEST:
            raise SymgenError(
                f"{robot.name}: MATLAB cuts names off after {LONGEST} characters, and {longest} has "
                f"{len(longest)}; give the robot a shorter name, or use another target"
            )
        results = file.results[0] if len(file.results) == 1 else f"[{', '.join(file.results)}]"
        arguments = f"({', '.join(file.arguments)})" if file.arguments else ""
        origin = (
            f"GENERATED from {robot.file or robot.name}, sha256 {robot.sha256[:12]}, by symgen "
            f"{VERSION}.",
            f"Do not edit; symgen generate {self.command} --target matlab",
            LICENCE,
        )
        context = {
            "signature": f"function {results} = {function}{arguments}",
            "about": [
                f"% {line}".rstrip()
                for text in (*file.about, "", *origin)
                for line in _wrapped(_comment(text))
            ],
            "sections": [section for section in file.sections if section.lines],
            "helpers": [name for name in HELPERS if name in read],
        }
        return laid_out("function.m", context, MATLAB)

    def _file(
        self,
        name: str,
        results: Sequence[str],
        arguments: Sequence[str],
        about: str,
        sections: Sequence[Section],
        used: Iterable[str] = (),
    ) -> File:
        """Make a file: its help text, the checks of its arguments, its constants, its sections.

        `used` lists the constants that its lines read.
        """
        function, states = f"{self.robot.name}_{name}", [x for x in arguments if x in STATES]
        varying = bool(states)  # from sample to sample
        last = ("constants",) * bool(self.free)
        lines: list[str] = []
        if self.free:
            lines += [
                f"if nargin < {len(arguments) + 1}",
                f"    constants = [{', '.join(map(_number, self.spec.regrouping.constants.values()))}];",
                "end",
            ]
        if varying:
            lines += ["N = size(q, 1);"]
            sizes = {x: MOTION if x == BASE[0] else self.n for x in states}
            wrong = [f"~isequal(size({x}), [N, {size}])" for x, size in sizes.items()]
            joints = ", ".join(x for x in states if x != BASE[0])
            said = f"expected {joints} of N rows and {self.n} columns"
            said += f", {BASE[0]} of N rows and {MOTION} columns" * (BASE[0] in states)
            lines += _refused(wrong, function, said)
        if "X" in arguments:
            lines += _refused(
                [f"numel(X) ~= {self.b}"], function, f"expected X of {self.b} base parameters"
            )
        if self.free:
            rows = ["~any(size(constants, 1) == [1, N])" if varying else "size(constants, 1) ~= 1"]
            rows += [f"size(constants, 2) ~= {len(self.free)}"]
            lines += _refused(rows, function, f"expected constants of {len(self.free)} columns")
        known = {c: f"constants(:, {k})" for k, c in enumerate(self.free, 1)}
        known |= {c: _number(x) for c, x in self.robot.constants.items() if c not in known}
        given = [f"{self.names.of_file(c)} = {x};" for c, x in known.items() if c in {*used}]
        explained = [
            f"{', '.join(x for x in states if x != BASE[0])} (N, {self.n}): a row for each sample, rad or "
            "m and seconds"
            if varying
            else "",
            f"base (N, {MOTION}): {BASE_MOTION}" if BASE[0] in states else "",
            f"X: base parameters, in the order of {self.robot.name}_{MODEL}"
            if "X" in arguments
            else "",
            f"constants: {', '.join(self.free)}, a row"
            + ", or a row for each sample" * varying
            + "; default: the values of the robot file"
            if self.free
            else "",
        ]
        return File(
            name,
            tuple(results),
            (*arguments, *last),
            (
                f"{function.upper()}  {about}",
                *(f"  {text}" for text in explained if text),
            ),
            (Section("Arguments", tuple(lines)), Section("Constants", tuple(given)), *sections),
        )

    def _of_block(self, block: Block) -> File:
        """Make the file of a model whose entries are formulas, such as the regressor."""
        f, model, result = block.function, block.function.model, block.result
        shape = f.shape[::-1] if model.by_columns else f.shape

        def entry(place: Sequence[int]) -> str:
            k = place[::-1] if model.by_columns else place
            return f"{result}(:, {', '.join(str(i + 1) for i in k) or 1})"

        preset = tuple(f"{entry(place)} = {_number(x)};" for place, x in f.preset)
        used = {n.value.name for n in f.nodes if n.op == SYM}
        about = f"{model.summary} Shape {tuple_of(('N', *shape))}; {f.cost}."
        if model.name == "regressor":
            about += f" reshape({result}, [], {shape[-1]}) is W of Y = W X + rho, rows joint-major."
        zeros = f"{result} = zeros({', '.join(map(str, ('N', *(shape or (1,)))))});"
        sections = (
            *block.sections,
            Section("Result", (zeros, *preset)),
            *block.results(entry),
        )
        return self._file(model.name, (result,), model.arguments, about, sections, used)

    def _base_parameters(self) -> File:
        regrouping, robot, function = self.spec.regrouping, self.robot, "base_parameters"
        read = {name for b in regrouping.base for name in b.combination}
        p = len(robot.parameters)
        lines = _refused(
            [f"numel(standard) ~= {p}"],
            f"{robot.name}_{function}",
            f"expected {p} standard parameters",
        )
        used = {s for b in regrouping.base for c in b.combination.values() for s in c.symbols}
        for name, ratio, sign in sign_conditions(regrouping):
            used |= {*ratio.symbols}
            holds = f"{self._value(ratio)} {'>' if sign > 0 else '<'} 0"
            said = (
                f"the formula of {name} holds where {ratio} is {'positive' if sign > 0 else 'negative'}, "
                "as in the robot file; for other constants, change the robot file and generate again"
            )
            lines += _refused([f"~({holds})"], f"{robot.name}_{function}", said)
        lines += [
            f"{self.names.of_file(name)} = standard({k});"
            for k, name in enumerate(robot.parameters, 1)
            if name in read
        ]
        values = [
            f"X({k}) = {self._named(MATLAB.expression(b.formula))};\t{b.name}"
            for k, b in enumerate(regrouping.base, 1)
        ]
        sections = (
            Section("Standard parameters", tuple(lines)),
            Section("Base parameters", (f"X = zeros({self.b}, 1);", *aligned(values, MATLAB))),
        )
        about = (
            f"X, shape ({self.b}, 1), from the {p} standard parameters in the order of "
            f"{robot.name}_{MODEL}."
        )
        return self._file(function, ("X",), ("standard",), about, sections, used)

    def _jacobian(self) -> File:
        """Make the file of the Jacobian: z x (P_frame - P_j) and z of the joints below the frame."""
        robot, closure = self.robot, self.spec.derivation.closure
        J, frames = self.names.inner().own(MODELS["jacobian"].result), len(robot.frames)
        column = {j: k for k, j in enumerate(closure.independent, 1)}
        rates = {
            (f.j, column[i]): g
            for f in robot.frames
            if f.sigma != FIXED
            for i, g in closure.row[f.j].items()
        }
        used = {symbol for g in rates.values() for symbol in g.symbols}
        slides = ", ".join(str(int(f.sigma == PRISMATIC)) for f in robot.frames)
        rows = "size(constants, 1)" if used else "1"
        lines = (
            f"antecedent = [{', '.join(str(f.ant) for f in robot.frames)}];",
            f"slides = [{slides}];",
            f"rate = zeros({rows}, {frames}, {self.n});",
            *(f"rate(:, {j}, {k}) = {self._value(g)};" for (j, k), g in rates.items()),
            f"poses = {robot.name}_frame_poses({', '.join(('q', *self._constants))});",
            f"{J} = zeros(N, 6, {self.n});",
            "joint = frame;",
            "while joint > 0",
            "    axis = reshape(poses(:, joint, 1:3, 3), N, 3);",
            "    arm = reshape(poses(:, frame, 1:3, 4) - poses(:, joint, 1:3, 4), N, 3);",
            "    if slides(joint)",
            "        twist = [axis, zeros(N, 3)];",
            "    else",
            "        twist = [axis(:, 2).*arm(:, 3) - axis(:, 3).*arm(:, 2), ...",
            "            axis(:, 3).*arm(:, 1) - axis(:, 1).*arm(:, 3), ...",
            "            axis(:, 1).*arm(:, 2) - axis(:, 2).*arm(:, 1), axis];",
            "    end",
            f"    for column = 1:{self.n}",
            "        for k = 1:6",
            f"            {J}(:, k, column) = {J}(:, k, column) + rate(:, joint, column).*twist(:, k);",
            "        end",
            "    end",
            "    joint = antecedent(joint);",
            "end",
        )
        default = (
            "if nargin < 2 || isempty(frame)",
            f"    frame = {frames};",
            "end",
            *_refused(
                [f"~isscalar(frame) || ~any(frame == 1:{frames})"],
                f"{robot.name}_jacobian",
                f"expected a frame from 1 to {frames}",
            ),
        )
        about = (
            "Velocity of the origin of `frame` (default: the last), then its angular velocity, in frame "
            f"0, per joint rate. Shape (N, 6, {self.n})."
        )
        sections = (Section("Frame", default), Section("Jacobian", lines))
        return self._file("jacobian", (J,), ("q", "frame"), about, sections, used)

    @property
    def _constants(self) -> tuple[str, ...]:
        return ("constants",) * bool(self.free)

    def _forward_dynamics(self) -> File:
        model = MODELS["forward_dynamics"].on(self.robot)
        bias, n = self.spec.functions["bias"].model.arguments, self.n
        lines = (
            f"rest = tau - {self.robot.name}_bias({', '.join((*bias, *self._constants))});",
            f"inertia = {self.robot.name}_inertia_matrix({', '.join(('q', 'X', *self._constants))});",
            f"qdd = zeros(N, {n});",
            "for t = 1:N",
            f"    qdd(t, :) = reshape(inertia(t, :, :), {n}, {n}) \\ reshape(rest(t, :), {n}, 1);",
            "end",
        )
        about = f"{model.summary} Shape (N, {n})."
        sections = (Section("Accelerations", lines),)
        return self._file(model.name, ("qdd",), model.arguments, about, sections)

    def _passive_joints(self) -> File:
        """Make the file of the passive joints, which are linear in the others."""
        robot, closure = self.robot, self.spec.derivation.closure
        place = {i: k for k, i in enumerate(closure.independent, 1)}
        used: set[str] = set()
        sections = []
        for state in ("q", "qd", "qdd"):
            lines = [f"{state}_passive = zeros(N, {len(robot.passive)});"]
            for k, j in enumerate(robot.passive, 1):
                row = {i: g for i, g in closure.row[j].items() if g}
                origin = [closure.offset[j]] if state == "q" and closure.offset[j] else []
                used |= {s for e in (*origin, *row.values()) for s in e.symbols}
                terms = [self._value(e) for e in origin]
                terms += [f"({self._value(g)}).*{state}(:, {place[i]})" for i, g in row.items()]
                lines.append(f"{state}_passive(:, {k}) = {' + '.join(terms) or '0'};")
            sections.append(Section(f"{state} of joints {list(robot.passive)}", tuple(lines)))
        about = (
            f"Positions, velocities and accelerations of the passive joints {robot.passive}. "
            f"Shape (N, {len(robot.passive)}) each."
        )
        results = ("q_passive", "qd_passive", "qdd_passive")
        return self._file("passive_joints", results, ("q", "qd", "qdd"), about, sections, used)

    def _model(self, blocks: Mapping[str, Block]) -> File:
        """Make the file of names and values, whose help text is the header of the robot."""
        robot, regrouping = self.robot, self.spec.regrouping
        title, texts = robot.title or robot.name, {name: b.text for name, b in blocks.items()}
        fields = {
            "joints": f"[{', '.join(map(str, robot.joints))}]",
            "base_parameters": _words(regrouping.names),
            "standard_parameters": _words(robot.parameters),
            "constants": _words(self.free),
            "constant_values": f"[{', '.join(map(_number, regrouping.constants.values()))}]",
            "standard_values": "["
            + ", ".join(_number(robot.values.get(name, float("nan"))) for name in robot.parameters)
            + "]",
            "X": f"[{', '.join(map(_number, self.spec.base_values))}]",
        }
        lines = tuple(f"{MODEL}.{name} = {text};" for name, text in fields.items())
        about = (
            f"{robot.name.upper()}_{MODEL.upper()}  {title}: names and values, a struct.",
            "  base_parameters and standard_parameters: the order of X and of the standard parameters",
            "  constants, constant_values: names and values of the constants of the robot file",
            "  standard_values, X: values of the robot file; NaN, and an empty X, where it has none",
            *_narrowed(header(self.spec, texts, formulas=True)),
        )
        return File(MODEL, (MODEL,), (), about, (Section("Names and values", lines),))

    # --- expressions ---

    def _value(self, e: Expression) -> str:
        """Write a constant expression, with the names of this file."""
        return self._named(MATLAB.expression(e))

    def _named(self, text: str) -> str:
        """Replace names of the robot file that are words of the language, except names of
        functions.
        """
        return re.sub(r"\b[A-Za-z]\w*\b(?!\()", lambda name: self.names.of_file(name[0]), text)


def _inputs(source: str, used: Sequence[tuple[int, str]], count: int) -> list[str]:
    """Write the lines that name columns of a state, or entries of X."""
    place = "({})" if source == "X" else "(:, {})"
    return [f"{name} = {source}{place.format(k + 1)};" for k, name in used]


def _refused(conditions: Sequence[str], function: str, said: str) -> list[str]:
    """Write the lines that raise an error if one of the conditions holds."""
    text = _comment(said).replace("'", "''")
    return [
        f"if {' || '.join(conditions)}",
        f"    error('symgen:{function}', '%s', '{text}')",
        "end",
    ]


def _wrapped(text: str) -> list[str]:
    """Break a line of a comment; the lines after the first are indented further."""
    indent = text[: len(text) - len(text.lstrip())]
    more = indent + "    "
    return wrap(text, WIDTH - 2, subsequent_indent=more, break_long_words=False) or [""]


def _narrowed(lines: Iterable[str]) -> list[str]:
    """Move the ends of lines that are too long for a comment to the start of the next line.

    A line that is indented further than the first line of its text continues this text.
    """
    made: list[str] = []
    rest, first = "", 0
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if rest and indent <= first:
            made.append(" " * (first + 4) + rest)
            rest = ""
        if rest:
            line = f"{' ' * indent}{rest} {line.lstrip()}"
        else:
            first = indent
        kept, *more = _wrapped(line)
        made.append(kept)
        rest = " ".join(x.strip() for x in more)
    return [*made, " " * (first + 4) + rest] if rest else made


def _number(x: float) -> str:
    return "NaN" if x != x else repr(float(x))


def _words(names: Sequence[str]) -> str:
    return "{" + ", ".join(f"'{name}'" for name in names) + "}"


def _comment(text: str) -> str:
    """Make a text safe in a comment, which ends with its line."""
    return "".join(c if c.isprintable() else " " for c in plain(text))
