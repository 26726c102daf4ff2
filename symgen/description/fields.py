"""Types of the fields of a Robot: how a file writes each field, and how the Robot stores it.

Each table of a robot file (`parts`, `robot`) is one pydantic dataclass. If a table is read from a
file, with a `Declared` as context, its fields are validated as the file writes them and converted
to the values that the Robot stores. If it is built in Python, its fields are used as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    Strict,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError, core_schema

from symgen.description.expression import Expression
from symgen.description.grammar import parse
from symgen.errors import DescriptionError, ExpressionError, SymgenError

Path = tuple[str | int, ...]  # keys that lead to a field of a robot file
Problem = tuple[object, str, Path]  # whether a field is wrong, the message, and the field
LARGEST = 1e60  # number that expressions may have
CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True, defer_build=True)


def dotted(path: Path) -> str:
    """Join the keys of a path by dots for messages, for instance frames.2.alpha."""
    return ".".join(str(key) for key in path)


@contextmanager
def located(file: str, line: Callable[[Path], int] = lambda _: 1) -> Iterator[None]:
    """Add the file name and line number to every DescriptionError that is raised in the block.

    `line` finds the line number from the path of the field. An error that already has a file or a
    line keeps it.
    """
    try:
        yield
    except DescriptionError as error:
        raise DescriptionError(
            error.message,
            path=error.path,
            file=error.file or file,
            line=error.line or line(error.path),
        ) from error.__cause__


@dataclass
class Declared:
    """Data needed to read the tables of a robot file: declared names, frames, and frame convention.

    Attributes
    ----------
    constants : frozenset of str
        Names of the constants.
    variables : frozenset of str
        Names of the constants and of the joint variables.
    rows : int
        Number of rows of the frame table.
    distal : bool
        Whether the table follows the classic (distal) convention.
    frames : tuple of Frame
        The frames, as soon as they are read.
    """

    constants: frozenset[str]
    variables: frozenset[str]
    rows: int
    distal: bool
    frames: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Given:
    """A field value that the reader of a robot file adds, such as the file name.

    The file has no key for this field.
    """

    value: Any


class Written:
    """Annotation of a Robot field: its type in a file, and a function that converts its value.

    The type is `form`; the function `turn` makes the value that the Robot stores.
    """

    def __init__(
        self, form: Any, turn: Callable[[Any, Declared], Any] = lambda value, _: value
    ) -> None:
        self.form, self.turn = form, turn

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Build the pydantic schema that validates the field as written in a file and converts it.

        In Python, without a file, the final value of the field is given and is not converted.
        """

        def read(value: Any, form: Callable[[Any], Any], info: ValidationInfo) -> Any:
            if info.context is None:
                return plain(value)
            try:
                return self.turn(form(value), info.context)
            except DescriptionError as error:
                raise problem(error) from error

        return core_schema.with_info_wrap_validator_function(
            read, handler.generate_schema(self.form)
        )


def problem(error: SymgenError) -> PydanticCustomError:
    """Convert an error of symgen to a pydantic error with the same message."""
    return PydanticCustomError("described", "{error}", {"error": error})


def _unwritten(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, Given):
        return value.value
    if info.context is not None:
        raise PydanticCustomError("unexpected_keyword_argument", "unknown key")
    return value


def _text(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError("expected a number or an expression such as q1, -pi/2 or D3 + 0.1")
    return value if isinstance(value, str) else repr(value)


def _expression(names: str, value: Any, info: ValidationInfo) -> Expression:
    if isinstance(value, Expression):
        return value
    try:
        return parse(_text(value), info.context and getattr(info.context, names))
    except ExpressionError as error:
        raise problem(error) from error


def _number(value: Any) -> float:
    if isinstance(value, float) and 1 / LARGEST <= abs(value) <= LARGEST:
        return value
    text = _text(value)
    try:
        number = float(parse(text, ()))
    except ExpressionError as error:
        message = f"expected a number or a constant expression such as pi/2; {error}"
        raise ValueError(message) from error
    except (ValueError, ArithmeticError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError("expected a number; this expression has no finite real value")
    return number


def _interval(value: Any) -> tuple[float, float]:
    if isinstance(value, list):
        if len(value) != 2:
            raise ValueError("expected [lower, upper], or one number for +- that number")
        return _number(value[0]), _number(value[1])
    return -_number(value), _number(value)


def plain(value: Any) -> Any:
    """Convert numbers of other packages (NumPy) to Python numbers, also in lists and tables."""
    if isinstance(value, Mapping):
        return {key: plain(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    kind = int if isinstance(value, Integral) else float if isinstance(value, Real) else None
    return kind(value) if kind else value


_NUMBER = WithJsonSchema({"type": ["number", "string"]})
UNWRITTEN: tuple[Any, ...] = (SkipJsonSchema(), BeforeValidator(_unwritten))  # type: ignore[type-arg]
Whole = Annotated[int, Strict()]
Text = Annotated[str, BeforeValidator(_text), _NUMBER]
Numeric = Annotated[float, BeforeValidator(_number), _NUMBER]
Interval = Annotated[
    tuple[float, float],
    BeforeValidator(_interval),
    WithJsonSchema({"type": ["number", "string", "array"]}),
]
Constant = Annotated[Expression, BeforeValidator(partial(_expression, "constants")), _NUMBER]
Position = Annotated[Expression, BeforeValidator(partial(_expression, "variables")), _NUMBER]
