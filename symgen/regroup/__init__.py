"""Base parameters with exact formulas, and their certificate.

Python gives a package's name precedence over the public function `symgen.regroup`, so the package can be called as that function.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from symgen.regroup.regrouping import Regrouping


class _CallablePackage(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Regrouping:
        from symgen.regroup.regrouping import regroup

        return regroup(*arguments, **options)


sys.modules[__name__].__class__ = _CallablePackage
