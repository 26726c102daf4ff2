"""Compiled models for tests of the fused kernels."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path

import pytest

from runtime import load_model
from runtime.model.compiled import CompiledModel, compiled_model
from runtime.resolution.c import kernels as fused
from runtime.resolution.c import self_test as fused_check
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler"
)


def in_c(robot: Robot, folder: Path) -> CompiledModel:
    """The robot in C, its module in `folder`."""
    for name, text in generate_files(robot, targets=("numpy", "c"), command=robot.name).items():
        (folder / name).write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = compiled_model(load_model(robot.name, folder=folder, trust=True))
    assert isinstance(model, CompiledModel)
    return model


def own_cache(folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Compile into `folder`; what was loaded from elsewhere is forgotten."""
    patch.setenv("SYMGEN_CACHE", str(folder))
    fused.library.cache_clear()
    fused_check.unavailable.cache_clear()
