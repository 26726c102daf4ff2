"""Types of the fields of a robot: how each is written in a file, and what the Robot holds.

A table of a robot file (`parts`, `robot`) is one pydantic dataclass. Read from a file, with a
`Declared` as context, its fields are validated as the file writes them and turned into what the
Robot holds; built in Python they are taken as they are.
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
CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


def dotted(path: Path) -> str:
    """The path as messages name it."""
    return ".".join(str(key) for key in path)


@contextmanager
def located(file: str, line: Callable[[Path], int] = lambda _: 1) -> Iterator[None]:
    """DescriptionErrors of a file name it, and the line of their path where they have none."""
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
    """Names that a robot file declares, and other context in which its tables are read.

    Names of constants; these and joint variables; the number of rows; whether they are distal; the frames read.
    """

    constants: frozenset[str]
    variables: frozenset[str]
    rows: int
    distal: bool
    frames: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Given:
    """A value that the reader adds to a table; the file has no key for it."""

    value: Any


class Written:
    """Annotation of a field: `form`, its type in a file; `turn` makes the field of it."""

    def __init__(
        self, form: Any, turn: Callable[[Any, Declared], Any] = lambda value, _: value
    ) -> None:
        self.form, self.turn = form, turn

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Schema of the form in a file; in Python the field itself is given."""

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
    """A pydantic error with our own message."""
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
    """Numbers of other packages as Python's, in tuples and tables too."""
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
