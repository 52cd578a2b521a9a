"""Both pages, written from one run: the report, and the README with the table in its place."""

from __future__ import annotations

from pathlib import Path

from benchmarks.publish.headline import headline_of
from benchmarks.publish.published import Published
from benchmarks.publish.report import report_of
from topoloc.errors import InputError
from topoloc.files import read_text, write_text

ROOT = Path(__file__).parents[2]
BEGIN, END = "<!-- headline: python -m benchmarks.publish -->", "<!-- end of headline -->"


def publish(folder: Path, times: Path | None = None, root: Path = ROOT) -> list[Path]:
    """Write both from a run; returns what was written.

    Args:
        folder: of a finished run of all scenarios of the headline.
        times: of another run that times are taken from: the machine may have done other work during the first one.
        root: of the project.

    Raises:
        InputError: the run is not finished, has not all that the headline needs, or the README has no place for it.
    """
    published = Published.of(folder)
    timed = published if times is None else Published.of(times)
    report, readme = root / "docs" / "reports" / f"{published.date}.md", root / "README.md"
    text = read_text(readme, "run this in the project")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(readme, "has no place for the headline table", f"put {BEGIN} and {END} around it")
    pages = {
        report: report_of(published, timed),
        readme: f"{before}{BEGIN}\n\n{headline_of(published)}\n\n{END}{after}",
    }
    for path, page in pages.items():
        write_text(path, page)
    return list(pages)
