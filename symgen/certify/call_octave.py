"""Call functions of MATLAB files in Octave, which runs in a process of its own.

The process stays for further calls, because its start takes half a second. A new process is started
if a function ended it or took too long. All data go through files of doubles: every value,
including a text, is an array (number of axes, their lengths, and the entries in the order of
Fortran).
"""

from __future__ import annotations

import atexit
import os
import queue
import shutil
import subprocess
import threading
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from symgen.derive.exact import Array

LONGEST_CALL = 120  # s, of all functions of a file
PROGRAMS = ("octave-cli", "octave")
DONE, ENDED = "symgen: done", "symgen: ended"
CALLS, RESULTS = "calls.bin", "results.bin"
SERVER = """\
1;
function x = read(f)
  d = fread(f, fread(f, 1, 'double'), 'double').';
  x = reshape(fread(f, prod(d), 'double'), d);
end
function x = packed(x)
  if iscellstr(x)
    x = strjoin(x(:).', ' ');
  end
  if ~(isreal(x) && (isnumeric(x) || ischar(x) || islogical(x)))
    error('a result holds no real numbers');
  end
  x = [ndims(x), size(x), double(x(:)).'];
end
sighup_dumps_octave_core(false);
sigquit_dumps_octave_core(false);
sigterm_dumps_octave_core(false);
while true
  folder = fgetl(stdin);
  if ~ischar(folder)
    break
  end
  if isempty(folder)
    continue
  end
  warning('off', 'all');
  addpath(folder);
  in = fopen(fullfile(folder, 'calls.bin'), 'r');
  out = fopen(fullfile(folder, 'results.bin'), 'w');
  for call = 1:fread(in, 1, 'double')
    name = char(read(in));
    given = cell(1, fread(in, 1, 'double'));
    results = cell(1, fread(in, 1, 'double'));
    for k = 1:numel(given)
      given{k} = read(in);
    end
    try
      [results{:}] = feval(name, given{:});
      if isstruct(results{1})
        results = [fieldnames(results{1}), struct2cell(results{1})].';
      end
      results = cellfun(@packed, results(:).', 'UniformOutput', false);
      fwrite(out, [0, numel(results), results{:}], 'double');
    catch failure
      fwrite(out, [1, 1, packed(failure.message)], 'double');
    end
  end
  fclose(in);
  fclose(out);
  rmpath(folder);
  texts = dir(fullfile(folder, '*.m'));
  for k = 1:numel(texts)
    clear(texts(k).name(1:end - 2));
  end
  printf('\\nsymgen: done\\n');
  fflush(stdout);
end
"""
"""Reads a folder from the standard input, calls what its file calls.bin says, and says when it is done;
leaves no file octave-workspace if a signal ends it."""


class Call(NamedTuple):
    """A call of a function: its name, its arguments, and the number of requested results."""

    name: str
    arguments: Sequence[Array]
    results: int = 1


class OctaveError(Exception):
    """A function failed, ended Octave, or took too long."""


def octave() -> str | None:
    """Return the path of Octave (the environment variable OCTAVE comes first), or None if there is
    no Octave.
    """
    return os.environ.get("OCTAVE") or next(filter(None, map(shutil.which, PROGRAMS)), None)


def called(texts: Mapping[str, str], calls: Sequence[Call]) -> list[list[Array]]:
    """Call functions of the files `texts`, and return the results of each call.

    A struct becomes the list of its names and values, a cell of words one text; texts are arrays of
    the codes of their characters. OctaveError is raised if a function fails, and if Octave ends or
    takes too long.
    """
    with TemporaryDirectory(prefix="symgen-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        job: list[float] = [len(calls)]
        for call in calls:
            job += [*_packed(np.array([[*call.name.encode()]])), len(call.arguments), call.results]
            job += [x for argument in call.arguments for x in _packed(argument)]
        np.array(job, dtype=float).tofile(folder / CALLS)
        _process().run(folder)
        numbers = np.frombuffer((folder / RESULTS).read_bytes())
    results: list[list[Array]] = []
    place = 0
    for _ in calls:
        failed, count = bool(numbers[place]), int(numbers[place + 1])
        place += 2
        arrays = []
        for _ in range(count):
            axes = int(numbers[place])
            shape = tuple(numbers[place + 1 : place + 1 + axes].astype(int))
            place += 1 + axes
            size = int(np.prod(shape))
            arrays.append(numbers[place : place + size].reshape(shape, order="F"))
            place += size
        if failed:
            raise OctaveError(text_of(arrays[0]))
        results.append(arrays)
    return results


def text_of(codes: Array) -> str:
    """Return the text whose characters have these codes."""
    return bytes(codes.ravel().astype(np.uint8)).decode("utf-8", "replace")


def _packed(a: Array) -> list[float]:
    """Return an array as its number of axes, their lengths and its entries; one axis is a row."""
    a = np.atleast_2d(np.asarray(a, dtype=float))
    return [a.ndim, *a.shape, *a.ravel(order="F")]


class _Octave:
    """A running Octave."""

    def __init__(self, program: str) -> None:
        self.folder = TemporaryDirectory(prefix="symgen-", ignore_cleanup_errors=True)
        server = Path(self.folder.name) / "server.m"
        server.write_text(SERVER, encoding="utf-8")
        command = [program, "--quiet", "--norc", "--no-history", "--no-window-system", str(server)]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))
        self.lines.put(ENDED)

    def run(self, folder: Path) -> None:
        """Let Octave do the calls of a folder."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(f"{folder}\n\n")  # fgetl waits for what follows a line
            self.process.stdin.flush()
            while (line := self.lines.get(timeout=LONGEST_CALL)) != DONE:
                if line == ENDED:
                    raise OctaveError("Octave ended")
        except (OSError, queue.Empty, OctaveError) as error:
            self.close()
            _process.cache_clear()
            raise OctaveError(str(error) or f"no answer in {LONGEST_CALL} s") from error

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.folder.cleanup()


@lru_cache(maxsize=1)
def _process() -> _Octave:
    program = octave()
    if program is None:
        raise OctaveError("there is no Octave")
    started = _Octave(program)
    atexit.register(started.close)
    return started
