"""Functions of the pages' modules, loaded into a browser from a running service and called from Python."""

import json
import math
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pytest

from models.friction.pressure_laws import AsymptoticPressureLaw, LinearPressureLaw
from service.api.clutch import ClutchIn
from service.api.life import QuantityName
from tests.browser.driving import chromium
from tests.browser.modules import Module, load, open_page
from tests.support import Server, serving

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service without clutches, which serves the files."""
    with serving(tmp_path_factory.mktemp("modules") / "clutchlife.db", loaded=True) as running:
        yield running


@pytest.fixture(scope="module")
def loaded(server: Server) -> Iterator[Callable[[str], Module]]:
    """A module by its name in the tree, in an empty page of the service."""
    with chromium() as browser:
        page = open_page(browser, server)
        yield lambda name: load(page, server, name)


def module(name: str) -> Any:
    """A fixture of a module."""
    return pytest.fixture(lambda loaded: loaded(name), scope="module")


frame = module("charts/frame.js")
bars = module("diagnosis/report.js")
criteria = module("quantities/criteria.js")
shown = module("shared/format.js")
law = module("charts/stribeck_law.js")


# --- Where a chart has its axes, ticks and legend.
FONT = {"family": "monospace", "size": 12}


def curve(x: list[Any], y: list[Any], **more: Any) -> dict[str, Any]:
    return {"x": x, "y": y} | more


def framed(frame: Module, *curves: dict[str, Any], width: int = 600, **axes: Any) -> dict[str, Any]:
    """A figure of one panel with its places."""
    figure = [{"x": {"title": "x"}, "y": {"title": "y"}, "curves": list(curves)} | axes]
    return frame("framed", figure, {"width": width, "height": 400})


def ranges(frame: Module, *curves: dict[str, Any], **axes: Any) -> tuple[list[float], list[float]]:
    (panel,) = framed(frame, *curves, **axes)["frames"]
    return panel["x"]["range"], panel["y"]["range"]


@pytest.mark.parametrize(
    ("span", "length", "least", "texts"),
    [
        ((0, 100), 400, 80, ["0", "20", "40", "60", "80", "100"]),
        ((0, 9), 800, 80, list("0123456789")),
        ((0, 100), 8000, 80, ["0", "20", "40", "60", "80", "100"]),  # never more than about nine
        ((0, 1), 160, 40, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        ((0.12, 0.14), 160, 40, ["0.120", "0.125", "0.130", "0.135", "0.140"]),
        ((-10, 10), 160, 40, ["−10", "−5", "0", "5", "10"]),
        ((3, 17), 160, 40, ["5", "10", "15"]),
        ((0, 12_000), 400, 80, ["0", "2,000", "4,000", "6,000", "8,000", "10,000", "12,000"]),
    ],
)
def test_ticks_are_one_two_or_five_times_a_power_of_ten(
    frame: Module, span: tuple[float, float], length: float, least: float, texts: list[str]
) -> None:
    ticks = frame("ticksOf", list(span), length, least)
    assert [tick["text"] for tick in ticks] == texts
    for tick in ticks:
        assert float(tick["text"].replace(",", "").replace("−", "-")) == pytest.approx(tick["at"])
        assert span[0] - 1e-9 <= tick["at"] <= span[1] + 1e-9


def test_a_range_leaves_room_about_what_is_drawn_and_its_error_bars(frame: Module) -> None:
    x, y = ranges(frame, curve([0, 10], [1, 3]))
    assert x == pytest.approx([-0.2, 10.2])
    assert y == pytest.approx([0.9, 3.1])
    x, _ = ranges(frame, curve([0, 10], [1, 3], marker={"color": "#000"}))
    assert x == pytest.approx([-0.5, 10.5])  # points would be cut at the edge
    _, y = ranges(frame, curve([0, 1, 2], [10, 20, None], half=[1, 2, 5]))
    assert y == pytest.approx([9 - 0.65, 22 + 0.65])
    _, y = ranges(frame, curve([0, 1], [10, 20], lower={"x": [0, 1], "y": [0, 5]}))
    assert y == pytest.approx([-1, 21])


@pytest.mark.parametrize(
    ("values", "zero", "expected"),
    [
        ([0, 10], True, [0, 10.2]),
        ([4, 10], True, [0, 10.2]),
        ([-5, 5], True, [-5.2, 5.2]),  # below zero it starts where the values start
        ([None, 2, 4, None], False, [1.96, 4.04]),
        ([None, None], False, [0, 1]),
        ([], False, [0, 1]),
        ([5, 5], False, [4.5, 5.5]),
        ([0, 0], False, [-1, 1]),
        ([float("nan"), 1, 2], False, [0.98, 2.02]),
    ],
)
def test_ranges_at_their_edges(frame: Module, values: list[Any], zero: bool, expected: list[float]) -> None:
    x, _ = ranges(frame, curve(values, [1] * len(values)), x={"title": "x", "zero": zero})
    assert x == pytest.approx(expected)


def test_logarithmic_axes_and_categories(frame: Module) -> None:
    (panel,) = framed(frame, curve([1, 1000, 0, None], [1, 1, 1, 1]), x={"title": "x", "log": True})["frames"]
    assert panel["x"]["range"] == pytest.approx([1 / 1000**0.02, 1000**1.02])
    assert [tick["text"] for tick in panel["x"]["ticks"]] == [
        "1",
        "2",
        "5",
        "10",
        "20",
        "50",
        "100",
        "200",
        "500",
        "1,000",
    ]
    (panel,) = framed(frame, x={"title": "x", "names": ["a", "b", "c"]})["frames"]
    assert panel["x"]["range"] == [-0.5, 2.5]
    assert [tick["text"] for tick in panel["x"]["ticks"]] == ["a", "b", "c"]


def test_a_legend_fits_beside_itself_or_breaks_into_rows(frame: Module) -> None:
    named = [curve([0, 1], [0, 1], name=name) for name in ("a", "bb", "ccc", "a")]
    short = framed(frame, *named, curve([0], [0]))
    entries = short["legend"]
    assert [entry["curve"]["name"] for entry in entries] == ["a", "bb", "ccc"]
    for before, entry in pairwise(entries):
        assert entry["x"] == pytest.approx(before["x"] + before["width"] + 5)
        assert entry["y"] == before["y"]
    long = framed(frame, *(curve([0, 1], [0, 1], name=n * 40) for n in "nmo"))
    rows = [entry["y"] for entry in long["legend"]]
    assert rows == sorted(set(rows))
    assert len({entry["x"] for entry in long["legend"]}) == 1
    assert long["frames"][0]["inside"]["height"] < short["frames"][0]["inside"]["height"]


def test_margins_hold_labels_and_titles(frame: Module) -> None:
    whole = framed(frame, curve([0, 1], [0, 1]), y={"title": "y", "range": [0, 9]})
    small, size = whole["frames"][0], whole["font"]["size"]
    assert (small["l"], small["t"]) == (56, 12)
    assert small["bottom"] - small["t"] - small["inside"]["height"] == pytest.approx(2.6 * size + 18)
    big = framed(frame, curve([0, 1], [0, 12_345_678]))["frames"][0]
    widest = max(frame("widthOf", tick["text"], whole["font"]) for tick in big["y"]["ticks"])
    assert big["l"] == round(max(56, widest + 1.3 * size + 24)) > 56


def test_panels_stand_beside_each_other_or_below_each_other(frame: Module) -> None:
    panel = {"x": {"title": "x"}, "y": {"title": "y"}, "curves": []}
    wide = frame("framed", [panel, panel], {"width": 900, "height": 400})
    narrow = frame("framed", [panel, panel], {"width": 390, "height": 400})
    assert [each["left"] for each in wide["frames"]] == [0, 450]
    assert [each["bottom"] for each in narrow["frames"]] == [320, 640]
    assert narrow["size"] == {"width": 390, "height": 640}


# --- Isolines, against closed forms.


def area(corners: list[list[float]]) -> float:
    """Of a polygon, positive anticlockwise."""
    return sum(a * d - b * c for (a, b), (c, d) in pairwise([*corners, corners[0]])) / 2


def test_isolines_of_a_plane_are_exact(loaded: Callable[[str], Module]) -> None:
    x, y = [0, 1, 3, 4], [0, 2, 5]
    found = loaded("charts/contours.js")("isolines", {"x": x, "y": y, "values": [[u + 2 * v for u in x] for v in y]}, 6)
    # above u + 2 v = 6: the rectangle less the corner with the corners (0, 0), (4, 0), (4, 1), (0, 3)
    assert sum(map(area, found["above"])) == pytest.approx(20 - 8)
    assert min(map(area, found["above"])) >= 0  # one way round: no seams between them
    assert sum(math.dist(*line) for line in found["lines"]) == pytest.approx(math.hypot(4, 2))
    assert all(u + 2 * v == pytest.approx(6) for line in found["lines"] for u, v in line)


def test_isolines_of_a_hill_and_where_a_value_is_missing(loaded: Callable[[str], Module]) -> None:
    isolines = loaded("charts/contours.js")
    steps = [(n - 30) / 10 for n in range(61)]
    hill: list[list[float | None]] = [[-u * u - v * v for u in steps] for v in steps]
    found = isolines("isolines", {"x": steps, "y": steps, "values": hill}, -4)
    assert sum(map(area, found["above"])) == pytest.approx(
        4 * math.pi, rel=0.005
    )  # the grid's step is 1/20 of the radius
    hill[30][30] = None
    found = isolines("isolines", {"x": steps, "y": steps, "values": hill}, -4)
    assert sum(map(area, found["above"])) == pytest.approx(4 * math.pi - 0.04, rel=0.005)  # four cells less


# --- The heading of a diagnosis, and remaining life before and after on one scale.


def test_the_heading_of_a_diagnosis_is_its_verdict(loaded: Callable[[str], Module]) -> None:
    report = loaded("diagnosis/report.js")
    diagnosis = {"verdict": "cause_ambiguous", "causes": ["oil_change", "inertia_torque"]}
    assert report("heading", diagnosis) == "Cause ambiguous"
    assert report("sentence", diagnosis) == "These runs leave open what is at work: oil change or inertia torque."


def test_what_is_improbable_or_chance_is_not_listed(loaded: Callable[[str], Module]) -> None:
    candidates = [
        {"effect": f"cause_{n}", "title": f"Cause {n}", "probability": p, "estimate": None}
        for n, p in enumerate((0.999, 0.3, 0.05, 0.014, 0.01, 0.006, 0.006))
    ]
    where = [
        {"axis": axis, "strength": strength, "p_value": p}
        for axis, strength, p in (
            ("speed_rpm", 5.0, 0.0001),
            ("cycles", 2.0, 0.009),
            ("time_s", 0.4, 1.0),
            ("gap", 0.2, 0.02),
        )
    ]
    misfit = {"rmse_nm": 1.0, "noise_nm": 1.0, "unexplained_share": 0.0}
    diagnosis = {"status": "finished", "verdict": "cause_named", "causes": [], "candidates": candidates}
    said = loaded("diagnosis/report.js").evaluate(
        f"m => m.report({json.dumps(diagnosis | {'baseline': misfit | {'where': where}})}).map((e) => e.textContent).join()"
    )
    assert [n for n in range(7) if f"Cause {n}" in said] == [0, 1, 2]
    assert [word for word in ("Speed", "Cycles", "Time", "Gap") if word in said] == ["Speed", "Cycles"]
    assert "weak" not in said


def test_what_is_computed_is_named_with_the_seconds_so_far(loaded: Callable[[str], Module]) -> None:
    said = loaded("shared/dom.js").evaluate("""m => {
      const [timers, place, { setInterval, Date }] = [[], document.createElement("p"), window];
      window.setInterval = (call) => timers.push(call);
      m.computing(place, "the lag over cycles");
      const first = place.textContent;
      const later = Date.now() + 12_000;
      window.Date = { now: () => later };
      timers[0]();
      Object.assign(window, { setInterval, Date });
      return [first, place.textContent];
    }""")
    assert said == ["Computing the lag over cycles …", "Computing the lag over cycles for 12 s …"]


BEFORE = {"0.05": 1000, "0.25": 1500, "0.5": 2000, "0.75": 2500, "0.95": 3000}
AFTER = {"0.05": 3000, "0.25": 3500, "0.5": 4000, "0.75": 4500, "0.95": 5000}
#: Width of a bar's drawing, and where its right end is in cycles for AFTER: 5 % past the larger 95 % quantile.
WIDTH, SCALE = 120, 1.05 * 5000


def show(bars: Module, before: Any, after: Any) -> dict[str, str]:
    return bars("lifeBars", {"before": before, "after": after})


def medians(html: str) -> list[float]:
    """Where the medians are, px."""
    return [float(x) for x in re.findall(r'class="median" x="([^"]+)"', html)]


def boxes(html: str, name: str) -> list[tuple[float, float]]:
    """Both ends of the bars of a kind, px."""
    found = re.findall(rf'class="{name}"[^>]*? x="([^"]+)" width="([^"]+)"', html)
    return [(float(x), float(x) + float(width)) for x, width in found]


def test_they_share_one_scale(bars: Module) -> None:
    html = show(bars, BEFORE, AFTER)["html"]
    assert medians(html) == pytest.approx([WIDTH * 2000 / SCALE, WIDTH * 4000 / SCALE], abs=0.06)
    wide, half = boxes(html, "wide"), boxes(html, "half")
    assert wide[0] == pytest.approx((WIDTH * 1000 / SCALE, WIDTH * 3000 / SCALE), abs=0.11)
    assert wide[1] == pytest.approx((WIDTH * 3000 / SCALE, WIDTH * 5000 / SCALE), abs=0.11)
    assert half[1] == pytest.approx((WIDTH * 3500 / SCALE, WIDTH * 4500 / SCALE), abs=0.11)
    assert 'class="beyond"' not in html


def test_an_end_that_is_not_in_sight_is_marked(bars: Module) -> None:
    result = show(bars, BEFORE, AFTER | {"0.75": None, "0.95": None})
    assert "(90 %: 3,000 to over 1,000,000)" in result["text"]
    assert result["html"].count('class="beyond"') == 1
    # the scale then goes 1.6 times as far as the median
    assert medians(result["html"])[1] == pytest.approx(WIDTH * 4000 / (1.05 * 1.6 * 4000), abs=0.06)
    never = show(bars, BEFORE, dict.fromkeys(AFTER))
    assert "After– (90 %: –)" in never["text"]
    assert len(medians(never["html"])) == 1


def test_quartiles_that_are_missing_are_taken_from_the_interval(bars: Module) -> None:
    ends = {name: AFTER[name] for name in ("0.05", "0.5", "0.95")}
    html = show(bars, BEFORE, ends)["html"]
    assert boxes(html, "half")[1] == boxes(html, "wide")[1]
    alone = show(bars, BEFORE, {"0.5": 4000})
    assert "After4,000 (90 %: –)" in alone["text"]


def test_without_quantiles_on_both_sides_there_is_nothing_to_compare(bars: Module) -> None:
    for nothing in (None, {}, {"remaining_cycles": {}}, {"status": "insufficient_data"}):
        assert show(bars, nothing, AFTER) is show(bars, BEFORE, nothing) is None


# --- Criteria in words, the remaining life that charts of mean COF show, and the band of a pressure law.
NONE = {"0.05": None, "0.5": None, "0.95": None}
PLACE = {"fraction": None, "below": None, "above": None, "pressure_bar": None, "speed_rpm": None, "frequency_hz": None}
SLOPE = PLACE | {"quantity": "slope", "below": 0.0, "pressure_bar": 5.0, "speed_rpm": 100.0}
MEAN_COF = PLACE | {"quantity": "mean_cof", "fraction": 0.5}
STOP = PLACE | {"quantity": "stop_time_s", "above": 1.2}
FILM = PLACE | {"quantity": "film_time", "above": 0.02, "pressure_bar": 4.0, "frequency_hz": 0.1}


def outcome(criterion: dict[str, Any], end: tuple[Any, Any, Any], now: float, **more: Any) -> dict[str, Any]:
    ends = dict(zip(NONE, end, strict=True))
    left = {level: None if at is None else max(0.0, at - now) for level, at in ends.items()}
    known = {"current": {"value": 0.1, "sd": 0.01}, "probability_of_reaching": 0.9, "probability_first": 0.5}
    return criterion | {"limit": 0.0, "end_of_life_cycles": ends, "remaining_cycles": left} | known | more


@pytest.mark.parametrize(
    ("criterion", "place", "limit"),
    [
        (SLOPE, "Slope dμ/dv, 100 rpm, 5.0 bar", "below 0 s/m"),
        (MEAN_COF, "Mean COF", "50 % of new"),
        (STOP, "Stop time", "above 1.20 s"),
        (FILM, "Film time, 0.10 Hz, 4.0 bar", "above 0.0200 s"),
    ],
)
def test_a_criterion_names_its_quantity_its_place_and_its_limit(
    criteria: Module, criterion: dict[str, Any], place: str, limit: str
) -> None:
    assert criteria("placeText", criterion) == place
    assert criteria("limitText", criterion) == limit


@pytest.mark.parametrize(
    ("end", "more", "text"),
    [
        (
            (8000, 9000, 10_000), {},
            "the limit 0 is reached at about 9,000 cycles (90 %: 8,000 to 10,000), 4,000 cycles from now",
        ),
        ((2000, 3000, 4000), {}, "the limit 0 has been reached at about 3,000 cycles (90 %: 2,000 to 4,000)"),
        (
            (9000, None, None), {"probability_of_reaching": 0.3},
            "the limit 0 may never be reached: it is reached with a probability of 30 %",
        ),
        ((None, None, None), {"probability_of_reaching": None}, "too few tests to predict when it is reached"),
    ],
)  # fmt: skip
def test_when_a_limit_is_reached_is_said_in_words(
    criteria: Module, end: tuple[Any, Any, Any], more: dict[str, Any], text: str
) -> None:
    assert criteria("reachedText", outcome(SLOPE, end, 5000, **more)) == text


def life(*ends: dict[str, Any]) -> dict[str, Any]:
    first = {name: ends[0][name] for name in ("end_of_life_cycles", "remaining_cycles")}
    criterion = ends[0] | {"threshold_mean_cof": None}
    return {"status": "predicted", "criterion": criterion, "criteria": list(ends)} | first


def test_charts_of_mean_cof_show_its_own_end_where_another_criterion_is_the_first(criteria: Module) -> None:
    slope = outcome(SLOPE, (5500, 6000, 6500), 5000)
    cof = outcome(MEAN_COF, (8000, 9000, 10_000), 5000, limit=0.07)
    answer = criteria("byMeanCof", life(slope, cof))
    assert answer["end_of_life_cycles"] == cof["end_of_life_cycles"]
    assert (answer["criterion"]["threshold_mean_cof"], answer["criterion"]["fraction"]) == (0.07, 0.5)
    assert answer["status"] == "predicted"
    passed = life(outcome(SLOPE, (1000, 2000, 3000), 5000), cof) | {"status": "reached"}
    assert criteria("byMeanCof", passed)["status"] == "predicted"  # its slope has ended it, not its mean COF
    without = criteria("byMeanCof", life(slope))
    assert without["end_of_life_cycles"] == NONE
    assert without["criterion"]["threshold_mean_cof"] is None


def test_what_limits_first_is_always_said(criteria: Module) -> None:
    slope, cof = outcome(SLOPE, (5500, 6000, 6500), 5000), outcome(MEAN_COF, (8000, 9000, 10_000), 5000)
    for ends in ((cof,), (slope,), (cof, slope)):
        assert len(criteria("criteriaTable", life(*ends))) == 1


def test_every_quantity_that_may_end_a_life_has_a_title(criteria: Module) -> None:
    for quantity in get_args(QuantityName):
        given = outcome(PLACE | {"quantity": quantity, "above": 1.0}, (5500, 6000, 6500), 5000)
        assert criteria("placeText", given) not in ("", quantity)
        assert criteria("criterionRow", given)[3] == "6,000"


LINEAR = {"intercept": 2.0, "slope_per_bar": 3.0, "covariance": [[0.04, -0.006], [-0.006, 0.0016]]}
FALLING = {
    "asymptote": 0.6, "excess": 4.0, "decay_bar": 1.6,
    "covariance": [[0.01, -0.02, 0.003], [-0.02, 0.09, -0.01], [0.003, -0.01, 0.005]],
}  # fmt: skip


@pytest.mark.parametrize(
    ("drawn", "law"),
    [
        (LINEAR, LinearPressureLaw(intercept=2.0, slope=3.0)),
        (FALLING, AsymptoticPressureLaw(asymptote=0.6, excess=4.0, decay=1.6)),
    ],
    ids=["linear", "falling"],
)
def test_a_law_is_drawn_with_the_band_of_its_covariance(
    loaded: Callable[[str], Module], drawn: dict[str, Any], law: LinearPressureLaw | AsymptoticPressureLaw
) -> None:
    laws = loaded("quantities/pressure_laws.js")
    for pressure in (4.0, 5.5, 7.0):
        at = np.array([pressure])
        (gradient,) = law.gradient(at)
        point, covariance = laws("lawAt", drawn, pressure), np.array(drawn["covariance"])
        assert point["value"] == pytest.approx(law(at)[0])
        assert point["sd"] == pytest.approx(np.sqrt(gradient @ covariance @ gradient))
        assert point["sd"] != pytest.approx(np.sqrt(covariance.diagonal() @ gradient**2))


# --- What a file's name says of its run, the form that registers a clutch, and names that are spelt almost alike.


def test_the_form_s_first_values_are_the_service_s_defaults(loaded: Callable[[str], Module]) -> None:
    code = "m => m.SECTIONS.flatMap(([, fields]) => fields.map(([path, , value]) => [path, value]))"
    shown = dict(loaded("sending/registration.js").evaluate(code))
    filled_in = ClutchIn(clutch_id="any").model_dump()
    del filled_in["end_of_life"]["criteria"]  # the form has mean COF's fraction alone
    for name in ("geometry", "oil", "end_of_life"):
        filled_in |= {f"{name}.{part}": value for part, value in filled_in[name].items()}
        assert {part for part in shown if part.startswith(name)} == {part for part in filled_in if f"{name}." in part}
    assert shown == {name: filled_in[name] for name in shown}


#: A diagnosis that runs, and what its job says at each poll, in place of the service's.
RUNNING = """async (m) => {
  const own = globalThis.fetch;
  const running = { diagnosis_id: "d", status: "running", created_at: "2026-11-02T08:00:00Z" };
  const steps = [null, { step: "reads the runs", done: 3, of: 10 }, { step: "diagnoses", done: null, of: null }];
  globalThis.fetch = async (address) => {
    const { pathname } = new URL(address, location.href);
    const job = { progress: pathname.includes("/jobs/") ? steps.shift() : null };
    return new Response(JSON.stringify({ "/c/diagnoses": { items: [running] }, "/v1/jobs/d": job }[pathname] ?? running));
  };
  const place = document.createElement("div");
  const { poll } = m.diagnosisTab(place, { path: "/c", name: () => "c", present: () => ({ runs: 3 }) }, async () => {});
  const said = [];
  while (steps.length > 0) {
    await poll();
    said.push(/Computing the diagnosis[^…]*…/.exec(place.textContent)?.[0]);
  }
  globalThis.fetch = own;
  return said;
}"""


def test_a_running_diagnosis_says_how_far_it_is(loaded: Callable[[str], Module]) -> None:
    assert loaded("diagnosis/diagnosis.js").evaluate(RUNNING) == [
        "Computing the diagnosis (waiting for its turn) …",
        "Computing the diagnosis (reads the runs, 3 of 10) …",
        "Computing the diagnosis (diagnoses) …",
    ]


def test_names_that_are_spelt_almost_alike(loaded: Callable[[str], Module]) -> None:
    similar = loaded("sending/similar_names.js")
    for typed in ("bench3-17", "Bench3_017", "bench3-071"):
        assert similar("similarTo", typed, ["bench3-017", "c1", "right"]) == ["bench3-017"]
    for typed in ("left", "c2"):  # of two letters, two may not differ
        assert similar("similarTo", typed, ["bench3-017", "c1", "right"]) == []


#: A list of three pages in place of the service's: what is read of it, and whether there is more.
PAGES = """async (m) => {
  const own = globalThis.fetch;
  const pages = { "": [[1, 2], "b"], b: [[3], "c"], c: [[4], null] };
  globalThis.fetch = async (address) => {
    const [items, next] = pages[new URL(address, location.href).searchParams.get("cursor") ?? ""];
    return new Response(JSON.stringify({ items, next }));
  };
  const read = [await m.readAll("/v1/list?limit=2"), await m.readAll("/v1/list", 1), await m.readAll("/v1/list", 2)];
  globalThis.fetch = own;
  return read.map(({ items, more }) => [items, more]);
}"""


def test_a_list_is_read_page_by_page_or_its_first_pages(loaded: Callable[[str], Module]) -> None:
    read = loaded("shared/api.js").evaluate(PAGES)
    assert read == [[[1, 2, 3, 4], False], [[1, 2], True], [[1, 2, 3], True]]


# --- Numbers as a person reads them: ordinary values, none at all, and the edges of each rule.
#: A function, its arguments as JSON, its text. Eight decimals at most; two digits stay however wide an interval is; no minus
#: before nothing but zeros; a first digit of 1 is followed by a second one; a clock may be ahead.
TABLE = """
quantity ["oil_temperature_c"]                 = Oil temperature, °C
quantity ["torque_nm"]                         = Torque, Nm
quantity ["cycles"]                            = Cycles
quantity ["mean_cof"]                          = Mean cof
quantity ["_c"]                                = , °C
quantity [""]                                  =
fixed [1234.5678, 2]                           = 1,234.57
fixed [0.5, 0]                                 = 1
fixed [-0.0004, 2]                             = 0.00
fixed [-0.006, 2]                              = −0.01
fixed [-0.0, 1]                                = 0.0
fixed [2.4]                                    = 2
significant [0, 3]                             = 0
significant [3.14159, 3]                       = 3.14
significant [31415.9, 3]                       = 31,400
significant [999.6, 3]                         = 1,000
significant [0.0012345, 3]                     = 0.00123
significant [0.0001, 1]                        = 0.0001
significant [9.9e-05, 2]                       = 9.9e−5
significant [-2e-05, 2]                        = −2.0e−5
significant [999999, 2]                        = 1,000,000
significant [1000000.0, 3]                     = 1.00e+6
significant [0.6666666666666666]               = 0.667
withSd [21.23456, 0.34]                        = 21.2 ± 0.3
withSd [21.23456, 0.14]                        = 21.23 ± 0.14
withSd [21.23456, 0.19999]                     = 21.23 ± 0.20
withSd [0.13412, 0.00112]                      = 0.1341 ± 0.0011
withSd [1234.5, 25]                            = 1,235 ± 25
withSd [-0.2, 0.05]                            = −0.20 ± 0.05
withSd [5, 0]                                  = 5.000
withSd [5, null]                               = 5.000
withSd [5, NaN]                                = 5.000
withSd [5, Infinity]                           = 5.000
withSd [1, 3e-12]                              = 1.00000000 ± 0.00000000
cycles [0]                                     = 0
cycles [7]                                     = 7
cycles [7000.4]                                = 7,000
cycles [12345, 10000, 15000]                   = 12,300
cycles [12345, 12000, 12150]                   = 12,350
cycles [12345, 0, 20]                          = 12,345
cycles [12345, 0, 1000000000.0]                = 12,000
cycles [123456]                                = 123,500
cycles [3, 0, 1000000.0]                       = 3
cycles [12345, 10000, null]                    = 12,350
cycles [-4321, 0, 1000000.0]                   = −4,300
interval [{"0.05": 1234, "0.5": 3, "0.95": 5678}] = 1,200 to 5,700
interval [{"0.05": 0, "0.5": 3, "0.95": 400}]  = 0 to 400
interval [{"0.05": 1234, "0.5": 3, "0.95": null}] = 1,200 to over 1,000,000
interval [{"0.05": 0.4, "0.5": 3, "0.95": null}] = 0 to over 1,000,000
interval [{"0.05": null, "0.5": 3, "0.95": null}] = –
interval [{"0.05": null, "0.5": 3, "0.95": 5678}] = – to 5,680
percent [0.123, 0]                             = 12 %
percent [0.123, 1]                             = 12.3 %
probability [0]                                = < 1 %
probability [0.00499]                          = < 1 %
probability [0.005]                            = 1 %
probability [0.5]                              = 50 %
probability [0.995]                            = > 99 %
probability [1]                                = > 99 %
age [-4999, 0]                                 = just now
age [3600000, 0]                               = just now
age [-5000, 0]                                 = 5 s ago
age [-59999, 0]                                = 59 s ago
age [-60000, 0]                                = 1 min ago
age [-3540000, 0]                              = 59 min ago
age [-3600000, 0]                              = 1 h ago
age [-82800000, 0]                             = 23 h ago
age [-86400000, 0]                             = 1 day ago
age [-172800000, 0]                            = 2 days ago
age [-31449600000, 0]                          = 364 days ago
age [-31536000000, 0]                          = 1 year ago
moment ["2026-11-02T08:00:00+01:00"]           = 2 Nov 2026, 08:00
moment ["2026-07-02T22:30:00Z"]                = 3 Jul 2026, 00:30
moment [""]                                    = –
moment [null]                                  = –
kindName ["stationary_stribeck"]               = Stationary Stribeck test
kindName ["another_kind"]                      = Another kind
words ["oil_change"]                           = Oil change
words [""]                                     =
words [7]                                      = 7
seconds [400]                                  = 1 s
seconds [1499]                                 = 1 s
seconds [1500]                                 = 2 s
seconds [59999]                                = 60 s
seconds [60000]                                = 1 min
"""
ROWS = [row.split(" =", 1) for row in TABLE.strip("\n").splitlines()]
CASES = [(called.split(" ", 1), text.strip()) for called, text in ROWS]


def test_numbers_are_shown_as_the_table_has_them(shown: Module) -> None:
    for (name, arguments), text in CASES:
        assert shown(name, *json.loads(arguments)) == text, (name, arguments)
    assert shown.evaluate("m => m.age(Date.now() - 3 * 60_000)") == "3 min ago"
    assert shown.evaluate("m => m.clock(new Date('2026-11-02T08:05:09+01:00'))") == "08:05:09"
    for name in ("fixed", "significant", "withSd", "cycles", "percent", "probability"):
        for nothing in ("null", "NaN", "Infinity", "-Infinity", "undefined"):
            assert shown.evaluate(f"m => m.{name}({nothing}, 1)") == "–", (name, nothing)


# --- Curves beside each other.


@pytest.mark.parametrize("static_torque", [20.0, 2e-5])
def test_curves_are_shares_of_their_highest_whatever_the_static_torque(law: Module, static_torque: float) -> None:
    """Of the static torque, a fit of friction that rises from zero went up to 1,000,000."""
    parameters = {"coulomb_ratio": 12.0 / static_torque, "stribeck_velocity_m_s": 4.0, "viscous_coefficient": 0.5}
    fit = {"pressure_bar": 5.0, "parameters": {"static_torque_nm": static_torque, **parameters}}
    clutch = {"geometry": {"inner_diameter_mm": 99, "outer_diameter_mm": 133, "mean_radius_mm": None}}
    curve = law("curveOf", fit, clutch, 0, 2000)
    highest = law("highestOf", curve)
    assert max(point["torque"] / highest for point in curve) == 1.0
    assert 5.0 < highest < 25.0
