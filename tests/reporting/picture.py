"""The picture of README.md, docs/index.md and docs/guide/verdict.md: the head of a report, `python tests/reporting/picture.py` (Chromium, Pillow)."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1])]

from browser import Browser, find_browser  # noqa: E402
from PIL import Image  # noqa: E402

import runtime  # noqa: E402
import symgen  # noqa: E402
from runtime.reading.records import read_records  # noqa: E402
from runtime.study import study_of  # noqa: E402

TARGET = Path(__file__).parents[2] / "docs" / "report_desktop.png"
WIDTH, HEIGHT = 1280, 1290


def main() -> None:
    """The report of the TX40 and its public record, down to the measured and predicted torques."""
    model = symgen.model("tx40")
    study, _ = study_of("tx40")
    records = read_records(study.record, model)
    result = runtime.identify(model, records, study, plausible=True)
    with tempfile.TemporaryDirectory() as folder, Browser(find_browser()) as page:
        runtime.report(result, folder)
        page.open(Path(folder) / "report.html", WIDTH, HEIGHT)
        image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        image.quantize(96, dither=Image.Dither.NONE).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
