"""The report's first matrix: node accuracy over the scenarios that most pairs ran on."""

from __future__ import annotations

from benchmarks.publish.markdown import code, percent, table
from benchmarks.publish.published import Published
from benchmarks.report.headline import BEST, LEVEL, PARTLY, Headline, headline_of
from benchmarks.spread import FEWEST_PAIRS, Pair


def overall(published: Published) -> str:
    """What it is over, and sensors by estimators; the same means as the first table of ``report.html``."""
    names = published.names("scenarios")
    recorded = [name for name in names if published.run.recorded(name)]
    headline = headline_of(published.run.rows, recorded)
    if headline.best is None:
        return "### All together\n\nNo run came to an end."
    told = [f"Mean over {', '.join(name for name in names if name in headline.compared)}, with equal weights."]
    if headline.one_drive:
        told.append("They are one recorded drive each, so no difference is told.")
    elif recorded:
        told.append(f"Left out, since one recorded drive tells no difference: {', '.join(recorded)}.")
    if any(cell.standing == PARTLY for cell in headline.cells.values()):
        told.append("† lacks one of these: the mean over those that the pair ran on, not held against the best.")
    return "\n\n".join(("### All together", " ".join(told), _matrix(published, headline)))


def _matrix(published: Published, headline: Headline) -> str:
    sensors = [name for name in published.names("sensors") if name in {pair[0] for pair in headline.cells}]
    body = (
        (code(estimator), *(_cell(headline, (sensor, estimator)) for sensor in sensors))
        for estimator in published.names("estimators")
    )
    return table(("", *map(code, sensors)), body)


def _cell(headline: Headline, pair: Pair) -> str:
    """In bold what cannot be told apart from the best; of recorded drives without an interval."""
    cell = headline.cells.get(pair)
    if cell is None:
        return ""
    text = percent(cell.mean, None if headline.one_drive else cell.interval)
    if cell.standing == PARTLY:
        return f"{text} †"
    told = headline.seeds >= FEWEST_PAIRS and not headline.one_drive
    return f"**{text}**" if told and cell.standing in (BEST, LEVEL) else text
