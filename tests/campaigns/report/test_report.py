"""A campaign makes its report, with it or afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rotorfault.base.errors import InputError
from rotorfault.cli.main import app


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--report-only"], "--out"),
        (["partial-loss-map", "--report-only", "--out", "x"], "give it alone"),
        (["--report-only", "--out", "nowhere"], "there is no such folder"),
    ],
)
def test_report_alone_says_what_it_needs(options: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["campaign", *options])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)


def test_campaign_makes_its_report(tmp_path: Path) -> None:
    text = """
    name = "tiny"
    scenario = "hover-fault"
    settings = { duration = 0.2, "fault.0.time" = 0.1 }
    variant = [{ label = "one" }]
    axis = [{ name = "loss", values = [0.0, 0.9] }]
    refine = { initial = 2, block = 2, most = 2 }
    """
    (tmp_path / "tiny.toml").write_text(text, encoding="utf-8")
    folder = tmp_path / "out"
    arguments = ["campaign", str(tmp_path / "tiny.toml"), "--out", str(folder)]
    done = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    assert "success.png" in done.stdout
    (folder / "report.html").unlink()
    (folder / "figures" / "recovery.svg").unlink()
    done = CliRunner().invoke(app, ["campaign", "--report-only", "--out", str(folder)], catch_exceptions=False)
    assert "success.png" in done.stdout
    assert (folder / "figures" / "recovery.svg").is_file()
    assert "Campaign tiny" in (folder / "report.html").read_text(encoding="utf-8")
