"""Pictures and page of a campaign, in its folder: figures/ and report.html."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from rotorfault.base.files import write_atomically
from rotorfault.campaigns.report.figures import draw
from rotorfault.campaigns.report.maps import maps
from rotorfault.campaigns.report.page import render
from rotorfault.campaigns.report.summary_figures import summary_figures
from rotorfault.campaigns.store.folder import PAGE
from rotorfault.campaigns.study import Study
from rotorfault.campaigns.summaries.parts import Summary
from rotorfault.report.figures import save

FIGURES = "figures"


def write(
    study: Study, table: pa.Table, folder: Path, versions: Mapping[str, str], summary: Summary | None = None
) -> list[Path]:
    """Draw the figures of a campaign and write its page, from its table.

    Parameters
    ----------
    study : Study
    table : pyarrow.Table
        All flights, or those there are so far.
    folder : Path
        Of the campaign.
    versions : mapping of str to str
        With which it was flown; under ``source`` the digest of the program's source.
    summary : Summary, optional
        What the study writes besides, from the same table.

    Returns
    -------
    list of Path
        The page first, then the figures.

    Raises
    ------
    InputError
        If no cell has a whole round yet, or the folder cannot be written.
    """
    numbers = maps(study, table)
    drawn = {} if summary is None else summary_figures(summary)
    figures = save({**draw(numbers), **drawn}, folder / FIGURES, ("png", "svg"))
    shown = {path.stem: path for path in figures if path.suffix == ".svg" and path.stem in ("grades", "recovery")}
    own = [path for path in figures if path.suffix == ".svg" and path.stem in drawn]
    text, page = render(numbers, folder, versions, shown, summary, own), folder / PAGE
    write_atomically(page, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return [page, *figures]
