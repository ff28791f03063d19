"""Maps of a campaign: numbers against tables whose counts are known, figures, page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from figure_checks import check_nothing_covered
from matplotlib.figure import Figure
from typer.testing import CliRunner

from rotorfault.analysis.hover import hover_margin
from rotorfault.base import versions
from rotorfault.base.errors import InputError
from rotorfault.campaigns.grades import GRADES
from rotorfault.campaigns.report import charts, curves, figures, report
from rotorfault.campaigns.report.limits import limits
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.campaigns.sampling.paired import difference_anytime, mcnemar_anytime, overall_difference
from rotorfault.campaigns.sampling.refine import Refinement, intervals
from rotorfault.campaigns.sampling.statistics import holm
from rotorfault.campaigns.study import Study, study_from
from rotorfault.cli.main import app
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle_file import load_vehicle

LOSS = {"name": "loss", "values": [0.0, 0.2, 0.4, 0.6, 0.8]}
WIND = {"name": "wind_speed", "values": [0.0, 4.0, 8.0]}
VARIANTS = [{"label": "one"}, {"label": "two"}]
TWO_FAULTS = {"fault": [{"kind": "step", "rotor": r, "time": 1.0, "loss": 0.3} for r in (1, 3)]}
FIRST = 8

Share = Callable[[str, tuple[int, ...]], float]
Flown = Callable[[str, int], int]


def study_of(axis: list[dict[str, Any]], **tables: Any) -> Study:
    refine = {"initial": FIRST, "block": FIRST, "most": 3 * FIRST, "width": 0.2}
    defaults = {"name": "made-up", "scenario": "hover-fault", "variant": VARIANTS, "refine": refine}
    return study_from({**defaults, "axis": axis, **tables}, "test")


def table_of(study: Study, share: Share, flown: Flown = lambda label, cell: FIRST) -> pa.Table:
    """A table in which the first flights of a cell are successful, rounded to the share, and the others are lost."""
    rows = []
    for k, variant in enumerate(study.variant):
        for cell in range(study.cells):
            place = tuple(int(i) for i in np.unravel_index(cell, study.shape))
            count = flown(variant.label, cell)
            successes = round(share(variant.label, place) * count)
            for number in range(count):
                success = number < successes
                rows.append(
                    {
                        "variant": variant.label,
                        "cell": cell,
                        "number": number,
                        "id": (number * study.cells + cell) * len(study.variant) + k,
                        "success": success,
                        "grade": ("held", "degraded")[number % 2] if success else "lost",
                        "recovery_time": 0.1 * (number + 1) if success else np.nan,
                        "altitude_lost": 0.01 * (number + 1) if success else 5.0,
                    }
                )
    return pa.Table.from_pylist(rows)


def falling(label: str, place: tuple[int, ...]) -> float:
    """A success rate that falls along the first axis, later for the first variant."""
    return float(np.clip(1.5 - 0.5 * place[0] + (0.25 if label == "one" else 0.0), 0.0, 1.0))


@pytest.fixture(scope="module")
def plane() -> Maps:
    study = study_of([LOSS, WIND])
    return maps(study, table_of(study, falling))


# --------------------------------------------------------------------------------------------------------- numbers


def test_counts_shares_and_intervals(plane: Maps) -> None:
    two = plane.variants[1]
    assert two.label == "two"
    np.testing.assert_array_equal(two.flights, np.full((5, 3), FIRST))
    np.testing.assert_array_equal(two.successes[:, 0], [8, 8, 4, 0, 0])
    np.testing.assert_array_equal(two.success_rate[:, 2], [1.0, 1.0, 0.5, 0.0, 0.0])
    bounds = intervals(two.successes, two.flights, plane.study.refine)
    np.testing.assert_array_equal([two.lower, two.upper], bounds)
    np.testing.assert_array_equal(two.grades[:, 2, 1], [2, 0, 2, 0, 0, 0, 4])
    np.testing.assert_allclose(two.shares[:, 2], [0.25, 0, 0.25, 0, 0, 0, 0.5])
    assert two.total.estimate == pytest.approx(0.5)
    assert 0.0 < two.total.lower < 0.5 < two.total.upper < 1.0
    assert plane.flights == 2 * 15 * FIRST
    assert plane.left_out == 0


def test_quantiles_do_not_leave_out_who_never_recovers(plane: Maps) -> None:
    two = plane.variants[1]
    np.testing.assert_allclose(two.recovery[:, 0, 0], [0.1, 0.4, 0.8])
    # Half of eight recover, so the fourth of them is the median; nine in ten do not.
    np.testing.assert_allclose(two.recovery[:, 2, 0], [0.1, 0.4, np.inf])
    np.testing.assert_allclose(two.recovery_along[:, 2], [0.1, 0.4, np.inf])
    assert np.isinf(two.recovery[:, 4]).all()
    # One that tumbles is over before it has fallen far: it counts as lost altogether.
    np.testing.assert_allclose(two.altitude[:, 2, 0], [0.01, 0.04, np.inf])


def test_flights_that_never_failed_have_no_recovery() -> None:
    study = study_of([LOSS])
    table = table_of(study, falling)
    none = pa.array(np.full(table.num_rows, np.nan))
    for name in ("recovery_time", "altitude_lost"):
        table = table.set_column(table.column_names.index(name), name, none)
    assert np.isnan(maps(study, table).variants[0].recovery).all()


def test_axis_values_in_any_order_make_the_same_map(plane: Maps) -> None:
    turned = study_of([{"name": "loss", "values": LOSS["values"][::-1]}, WIND])
    found = maps(turned, table_of(turned, lambda label, place: falling(label, (4 - place[0], place[1]))))
    np.testing.assert_array_equal(found.variants[0].successes, plane.variants[0].successes)
    assert found.views[0].values == LOSS["values"]
    np.testing.assert_array_equal(found.variants[0].cell[0], [12, 13, 14])


def test_only_whole_rounds_in_a_row_count() -> None:
    study = study_of([LOSS])
    table = table_of(study, lambda *_: 0.5, lambda label, cell: FIRST + 3 if cell == 2 else FIRST)
    # Of cell 3 the first flight is not there yet, as when its block is still flying.
    keep = ~((table["cell"].to_numpy() == 3) & (table["number"].to_numpy() == 0))
    found = maps(study, table.filter(keep))
    np.testing.assert_array_equal(found.variants[0].flights, [FIRST, FIRST, FIRST, 0, FIRST])
    assert np.isnan(found.variants[0].success_rate[3])
    assert found.left_out == 2 * (3 + FIRST - 1)
    assert not found.complete
    with pytest.raises(InputError, match="no cell has a whole round"):
        maps(study, table.slice(0, FIRST - 1))


def test_totals_compare_the_same_cells() -> None:
    study = study_of([LOSS])
    table = table_of(study, lambda _, place: 1.0 - 0.5 * (place[0] % 2))
    missing = (table["variant"].to_numpy(zero_copy_only=False) == "two") & (table["cell"].to_numpy() == 1)
    found = maps(study, table.filter(~missing))
    assert found.compared == 4
    assert [float(variant.total.estimate) for variant in found.variants] == [0.875, 0.875]
    assert float(found.pairings[0].total.estimate) == 0.0


def test_a_campaign_is_complete_when_sampling_asks_for_no_more(plane: Maps) -> None:
    assert not plane.complete  # cells with half of their flights lost are not narrow yet
    study = study_of([LOSS], refine={"initial": FIRST, "block": FIRST, "most": FIRST})
    assert maps(study, table_of(study, falling)).complete


def test_the_first_flight_that_failed_is_named(plane: Maps) -> None:
    two = plane.variants[1]
    np.testing.assert_array_equal(two.first_failure[:2], -1)
    cell, number = 2 * 3, 4
    assert two.first_failure[2, 0] == (number * 15 + cell) * 2 + 1


def test_pairs_are_the_flights_that_both_flew() -> None:
    study = study_of([LOSS])
    # Eight flights in common; of these one survives 6 (of its 16 flights too, it is 6) and two survives 4.
    share = {"one": 6 / 16, "two": 4 / 8}
    found = maps(study, table_of(study, lambda label, _: share[label], lambda label, _: {"one": 16, "two": 8}[label]))
    pair = found.pairings[0]
    np.testing.assert_array_equal(pair.counts.pairs, 8)
    np.testing.assert_array_equal(pair.counts.only_first, 2)
    np.testing.assert_array_equal(pair.counts.only_second, 0)
    np.testing.assert_array_equal(pair.first_apart, 4)
    np.testing.assert_array_equal(pair.difference, np.array(difference_anytime(*pair.counts)))
    np.testing.assert_array_equal(pair.p_value, holm(mcnemar_anytime(*pair.counts[:2])))
    np.testing.assert_array_equal(pair.total, np.array(overall_difference(*pair.counts)))


def test_differences_are_significant_where_they_must_be() -> None:
    study = study_of([LOSS], refine={"initial": 24, "block": 24, "most": 24})
    table = table_of(study, lambda label, place: float(label == "one" or place[0] != 1), lambda *_: 24)
    np.testing.assert_array_equal(maps(study, table).pairings[0].significant, [False, True, False, False, False])


# ---------------------------------------------------------------------------------------------- boundaries, limits


def test_boundaries_go_where_they_must(plane: Maps) -> None:
    (part,), count = curves.slices(plane)
    assert count == 1
    half = curves.crossings(plane, plane.variants[1], part, 0.5)
    # Success rate 1, 0.5, 0 at losses 0.2, 0.4, 0.6, in every wind.
    assert (half.along == 0).all()
    np.testing.assert_allclose(half.points, [[0.4, 0.0], [0.4, 4.0], [0.4, 8.0]])
    np.testing.assert_allclose(half.lines[0][:, 0], 0.4)
    high = curves.crossings(plane, plane.variants[1], part, 0.99)
    np.testing.assert_allclose(high.points[:, 0], 0.2 + 0.2 * 0.02)
    bounds = intervals([24, 12, 0], 24, Refinement(initial=24, block=24, most=24))
    flown = study_of([LOSS, WIND], refine={"initial": 24, "block": 24, "most": 24})
    many = maps(flown, table_of(flown, falling, lambda *_: 24))
    half = curves.crossings(many, many.variants[1], part, 0.5)
    lower = 0.2 + 0.2 * (bounds.lower[0] - 0.5) / (bounds.lower[0] - bounds.lower[1])
    np.testing.assert_allclose(half.lower, lower)
    np.testing.assert_allclose(half.upper, 0.8 - lower)


def test_boundaries_are_looked_for_across_them() -> None:
    study = study_of([LOSS, WIND])
    found = maps(study, table_of(study, lambda _, place: 1.0 - 0.5 * place[1]))
    across = curves.crossings(found, found.variants[0], curves.slices(found)[0][0], 0.75)
    assert (across.along == 1).all()
    assert len(across.along) == 5
    np.testing.assert_allclose(across.points[:, 1], 2.0)


def test_boundaries_with_a_corner_have_intervals_on_both_sides_of_it() -> None:
    study = study_of([LOSS, {"name": "second_loss", "values": LOSS["values"]}], settings=TWO_FAULTS)
    found = maps(study, table_of(study, lambda _, place: float(max(place) < 3)))
    half = curves.crossings(found, found.variants[0], curves.slices(found)[0][0], 0.5)
    for axis in (0, 1):
        np.testing.assert_allclose(
            half.points[half.along == axis], np.roll([[0.5, 0], [0.5, 0.2], [0.5, 0.4]], axis, 1)
        )


def test_attainable_cells_are_those_of_the_hover_margin(plane: Maps) -> None:
    vehicle = load_vehicle("paper").vehicle
    possible = plane.variants[0].possible
    assert possible is not None
    for at in np.ndindex(5, 3):
        loss, speed = LOSS["values"][at[0]], WIND["values"][at[1]]
        margin = hover_margin(vehicle, PerRotor(loss, 0.0, 0.0, 0.0), Vec3(speed, 0.0, 0.0))
        assert (possible.with_yaw[at], possible.without_yaw[at]) == (margin.with_yaw, margin.without_yaw)
    assert 0.0 < possible.with_yaw.mean() < possible.without_yaw.mean() <= 1.0


def test_attainable_knows_mismatch_second_faults_and_onset() -> None:
    settings = {**TWO_FAULTS, "mismatch.mass": 1.1}
    study = study_of([{"name": "second_loss", "values": [0.0, 0.5]}], settings=settings)
    vehicle = load_vehicle("paper").vehicle
    heavy = vehicle._replace(mass=1.1 * vehicle.mass)
    found = limits(study, 0, {"second_loss": np.array([0.0, 0.5])})
    for k, loss in enumerate((0.0, 0.5)):
        margin = hover_margin(heavy, PerRotor(0.3, 0.0, loss, 0.0))
        assert (found.with_yaw[k], found.without_yaw[k]) == (margin.with_yaw, margin.without_yaw)
    late = study_of([{"name": "onset", "values": [1.0, 30.0]}], settings={"fault.0.loss": 0.9})
    np.testing.assert_array_equal(limits(late, 0, {"onset": np.array([1.0, 30.0])}).with_yaw, [0.0, 1.0])


def test_attainable_is_not_told_where_it_depends_or_is_not_known() -> None:
    drawn = study_of([LOSS], draw=[{"name": "mass", "uniform": [0.5, 1.5]}])
    values = {"loss": np.array(LOSS["values"])}
    found = limits(drawn, 0, values)
    assert np.isnan(found.with_yaw).any()
    assert not np.isnan(limits(drawn, 0, values, middle=True).with_yaw).any()
    no_matter = study_of([LOSS], draw=[{"name": "wind_direction", "uniform": [-3.0, 3.0]}])
    assert not np.isnan(limits(no_matter, 0, values).with_yaw).any()
    fault = {"kind": "stuck", "rotor": 1, "time": 1.0, "thrust": 1.0}
    stuck = study_of([WIND], settings={"fault": [fault]})
    assert limits(stuck, 0, {"wind_speed": np.array([0.0])}) is None


def test_limits_between_cells_are_at_the_critical_loss(plane: Maps) -> None:
    found = curves.edges(plane, 0, curves.slices(plane)[0][0])
    vehicle = load_vehicle("paper").vehicle
    critical = 1.0 - vehicle.mass * vehicle.gravity / (4.0 * vehicle.rotor_gain * vehicle.thrust_max)
    line = found.with_yaw[0]
    assert line[np.argmin(line[:, 1]), 0] == pytest.approx(critical, abs=1e-5)


# ---------------------------------------------------------------------------------------------------- figures, page

SPACE = [LOSS, WIND, {"name": "rotor", "values": [1.0, 3.0]}]
ODD = [{"name": "detection_delay", "values": [0.0, 0.005, 0.05, 1.0]}, {"name": "rotor", "values": [1.0, 2.0]}]
STUDIES = {
    "plane": study_of([LOSS, WIND]),
    "line": study_of([LOSS]),
    "names": study_of([{"name": "preset", "values": ["paper", "tuned"]}], variant=[{"label": "only"}]),
    "space": study_of(SPACE),
    "odd": study_of(ODD, variant=[{"label": f"a rather long name of variant {k}"} for k in range(4)],
                    settings={"diagnosis.kind": "delayed"}),
}  # fmt: skip


@pytest.fixture(scope="module", params=list(STUDIES))
def made(request: pytest.FixtureRequest) -> tuple[str, Maps, dict[str, Figure]]:
    study = STUDIES[request.param]
    found = maps(study, table_of(study, falling))
    return request.param, found, figures.draw(found)


def test_figures_cover_nothing(made: tuple[str, Maps, dict[str, Figure]]) -> None:
    name, _, drawn = made
    wanted = {
        "plane": {"success", "difference", "grades", "recovery"},
        "line": {"success", "difference", "grades", "recovery"},
        "names": {"success", "grades", "recovery"},
        "space": {"success-one", "success-two", "difference-one-two", "grades", "recovery"},
        "odd": {"success", "difference", "grades", "recovery"},
    }
    assert set(drawn) == wanted[name]
    for title, figure in drawn.items():
        figure.canvas.draw()
        check_nothing_covered(f"{name} {title}", figure)


class Parsed(HTMLParser):
    """Elements that are open, and what refers to elsewhere."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.references += [value or "" for key, value in attrs if key in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    study = STUDIES["plane"]
    folder = tmp_path_factory.mktemp("a campaign")
    paths = report.write(study, table_of(study, falling), folder, {"rotorfault": "0.0"})
    assert [path.name for path in paths[:3]] == ["report.html", "success.png", "success.svg"]
    assert all(path.stat().st_size > 1000 for path in paths)
    text = paths[0].read_text(encoding="utf-8")
    assert f"rotorfault replay '{folder}'" in text.replace("&#39;", "'")
    return text


def test_page_is_whole_and_needs_nothing_else(page: str) -> None:
    parsed = Parsed()
    parsed.feed(page)
    assert parsed.open == []
    assert all(reference.startswith("data:") for reference in parsed.references)
    assert len(parsed.references) == 2
    assert page.count("<script") - page.count('type="application/json"') == 2
    assert "plotly.js v" in page


def test_page_has_the_numbers_and_commands_of_every_cell(page: str, plane: Maps) -> None:
    specs = json.loads(re.search(r'<script type="application/json" id="specs">(.*?)</script>', page, re.DOTALL)[1])
    assert len(specs) == 3
    for spec, variant in zip(specs[:2], plane.variants, strict=True):
        heat = spec["data"][0]
        np.testing.assert_allclose(np.array(heat["z"], dtype=float), variant.success_rate.T, atol=1e-5)
        for (i, j), successes in np.ndenumerate(variant.successes):
            where, said, command, _ = heat["customdata"][j][i]
            assert where == f"loss {LOSS['values'][i]:g}, wind speed {WIND['values'][j]:g} m/s"
            assert f"success {successes} of {FIRST}" in said
            failure = f"--flight {variant.first_failure[i, j]}"
            none = f"--cell {variant.cell[i, j]} --variant {variant.label}"
            assert command.endswith(none if successes == FIRST else failure)
    table = page[page.index('id="cells"') :]
    assert table.count("<code>rotorfault replay") == 2 * 15
    pair = specs[2]["data"][0]["customdata"][0][1]
    assert len(pair[2].splitlines()) == 2
    for grade in GRADES:
        assert f"<dt>{grade}" in page


def test_charts_are_what_plotly_takes() -> None:
    graph_objects = pytest.importorskip("plotly.graph_objects")
    for name, study in STUDIES.items():
        found = maps(study, table_of(study, falling))
        cells = charts.variant_cells(found, 0, Path("campaign"))
        if len(found.views) == 1:
            specs = [charts.success_lines_chart(found, 0, cells)]
            specs += [charts.difference_lines_chart(found, 0, cells)] if found.pairings else []
        else:
            parts = curves.slices(found)[0]
            specs = [charts.success_chart(found, 0, part, cells) for part in parts]
            specs += [charts.difference_chart(found, 0, part, cells) for part in parts]
            assert len(specs) == 2 * (2 if name == "space" else 1)
        for spec in specs:
            graph_objects.Figure(json.loads(json.dumps(spec, allow_nan=False)))


def test_no_more_slices_than_can_be_looked_at() -> None:
    study = study_of(
        [LOSS, WIND, {"name": "mass", "start": 0.8, "stop": 1.2, "count": 9}], variant=[{"label": "one"}]
    )
    found = maps(study, table_of(study, falling))
    parts, count = curves.slices(found)
    assert (len(parts), count) == (curves.MOST_SLICES, 9)
    assert (parts[0].title, parts[-1].title) == ("mass 0.8", "mass 1.2")
    assert "6 of 9" in figures.draw(found)["success-one"].legends[0].get_title().get_text()


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
    done = CliRunner().invoke(app, [*arguments, "--no-report"], catch_exceptions=False)
    assert done.exit_code == 0
    assert not (folder / "report.html").exists()
    done = CliRunner().invoke(app, ["campaign", "--report-only", "--out", str(folder)], catch_exceptions=False)
    assert "success.png" in done.stdout
    assert (folder / "figures" / "recovery.svg").is_file()
    assert "Campaign tiny" in (folder / "report.html").read_text(encoding="utf-8")


def test_pictures_decide_no_numbers() -> None:
    """A change to a picture must not keep anybody from going on with a campaign; a misspelt file would."""
    root = Path(versions.__file__).parents[1]
    for place in versions._IDLE:
        assert (root / place).exists(), place
    drawing = re.compile(r"^(from|import) matplotlib", re.MULTILINE)
    pictures = {path.parent for path in (root / "campaigns").rglob("*.py") if drawing.search(path.read_text())}
    assert pictures == {root / "campaigns" / "report"}
    assert "campaigns/report" in versions._IDLE
