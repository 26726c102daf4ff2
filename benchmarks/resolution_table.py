"""The resolution study of the TX40 under every choice of rounding, side, columns and filter: mean
ZZ1R against Table 3, and CPU time.

    python benchmarks/resolution_table.py          needs the record `tx40`: set SYMGEN_DATA, or be on line

One BLAS thread. The table is the one in the report of `symgen demo`; the times are those of the
whole demo, step by step.
"""

import time
from itertools import pairwise

from symgen.cli.session import single_thread

single_thread()

# numpy reads the number of threads when it loads
from symgen.demo.tx40 import demonstrate, prepare  # noqa: E402
from symgen.demo.tx40_page import KEY, TOLERANCE  # noqa: E402
from symgen.demo.tx40_tables import TABLE_3  # noqa: E402


def main() -> None:
    """Print the table and the times."""
    marks = [("start, robot file, record", 0.0)]

    shown = demonstrate(
        prepare(quick=False),
        quick=False,
        progress=lambda text: marks.append((text, time.process_time())),
    )
    marks.append(("end", time.process_time()))

    print(
        f"{'mean ' + KEY:70s}"
        + "".join(f"{level.level.label:>12s}" for level in shown.resolution.levels)
    )
    print(f"{'Table 3':70s}" + "".join(f"{value:12.3f}" for value in TABLE_3[KEY]))
    for label, result in shown.combinations.items():
        means = [level.mean[result.names.index(KEY)] for level in result.levels]
        ok = all(
            abs(mean - value) <= TOLERANCE for mean, value in zip(means, TABLE_3[KEY], strict=True)
        )
        print(
            f"{label:70s}" + "".join(f"{mean:12.3f}" for mean in means) + ("  within" if ok else "")
        )
    print()
    for (text, begin), (_, end) in pairwise(marks):
        print(f"{end - begin:7.2f} s CPU  {text}")


if __name__ == "__main__":
    main()
