"""Report: one self-contained page with everything of the run, nothing of it as markup."""

import base64
from html.parser import HTMLParser

import pytest

from reporting import page as pages
from reporting.metrics import Metrics
from reporting.page import Fact, Table
from reporting.style import Figure

VOID = {"meta", "br", "img", "link", "hr", "input"}


class Page(HTMLParser):
    """Tags with attributes and all text of a page; fails on tags that do not match."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(html)
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if not self._open or self._open[-1] != "style":
            self.text += data

    def values(self, tag: str, attribute: str) -> list[str]:
        return [a[attribute] for t, a in self.tags if t == tag and a.get(attribute)]


PNG = b"\x89PNG of a red sheet"


@pytest.fixture
def run():
    metrics = Metrics()
    metrics.add("max_path_deviation", 4.32e-5, "m", "< 0.05e-3", "Sec. <b>3.8.3")
    metrics.add("controller_tick_us_p99", 271.0, "us", "<= 250")
    metrics.add("peak_torque_1", 775.0, "Nm")
    return {
        "title": "pfc_<b>elastic</b>",
        "description": "Follow a & b",
        "scenario_yaml_text": "name: x\nnote: '</pre><script>alert(1)</script>'\n",
        "metrics": metrics,
        "figures": [Figure("path", "The <path>", 'A "caption"', PNG)],
        "log_attributes": {"git_revision": "abc+dirty", "drake_version": "1.51.1"},
    }


def report_page(**content):
    return pages.Page(**content).html()


def read(html) -> tuple[Page, str]:
    return Page(html), html


def test_everything_is_on_the_page(run):
    page, _ = read(report_page(**run))
    for text in (
        "pfc_<b>elastic</b>",
        "Follow a & b",
        "</pre><script>alert(1)</script>",
        "The <path>",
        'A "caption"',
        "Sec. <b>3.8.3",
        "abc+dirty",
        "1.51.1",
        "43.2\u202fµm",
        "<\u202f50\u202fµm",
        "completed",
        "1 of 2 targets met",
        "Max path deviation",
        "Controller tick p99",
        "peak_torque_1",
    ):
        assert text in page.text, text


def test_nothing_of_the_run_becomes_markup_and_nothing_is_fetched(run):
    page, html = read(report_page(**run, recording="recording.html"))
    assert {tag for tag, _ in page.tags}.isdisjoint({"script", "b", "path", "link"})
    assert "http:" not in html
    assert "https:" not in html
    assert "{{" not in html
    assert "{%" not in html
    (source,) = page.values("img", "src")
    assert base64.b64decode(source.split(",")[1]) == PNG


def test_linear_drives_have_forces(run):
    run["metrics"].add("peak_torque_2", 120.0, "N")
    page, _ = read(report_page(**run))
    assert "Peak force 2" in page.text
    assert "peak_torque_2" in page.text  # the name in metrics.json
    assert "Peak torque 1" in page.text


def test_targets_are_judged(run):
    page, html = read(report_page(**run))
    assert html.count("✓ met") == html.count("✗ missed") == 2  # card and table
    assert page.text.index("43.2") < page.text.index("271")


def test_cards_without_targets_show_the_first_metrics(run):
    for metric in run["metrics"].values():
        metric.target = None
    page, html = read(report_page(**run))
    assert html.count('class="card"') == 3
    assert "targets met" not in page.text


def test_fault(run):
    page, _ = read(report_page(**run, fault="singular at <A>"))
    assert "stopped by fault" in page.text
    assert "singular at <A>" in page.text
    assert "completed" not in page.text


def test_interruption(run):
    page, _ = read(report_page(**run, interrupted=True))
    assert "interrupted" in page.text
    assert "completed" not in page.text
    page, _ = read(report_page(**run, interrupted=True, fault="singular"))
    assert "stopped by fault" in page.text


def test_recording_is_linked_relative_to_the_page(run):
    page, _ = read(report_page(**run, recording="a folder/recording.html"))
    assert page.values("iframe", "src") == ["a%20folder/recording.html"]
    assert page.values("a", "href") == ["a%20folder/recording.html"]
    page, _ = read(report_page(**run))
    assert page.values("iframe", "src") == []


def test_diagram_is_an_image(run):
    svg = "<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>"
    page, _ = read(report_page(**run, diagram_svg=svg))
    source = page.values("img", "src")[1]
    assert source.startswith("data:image/svg+xml;base64,")
    assert base64.b64decode(source.split(",")[1]).decode() == svg
    assert "Block diagram" in page.text


def test_works_without_metrics_and_figures(run):
    run.update(metrics=Metrics(), figures=[])
    page, _ = read(report_page(**run))
    assert "All metrics" not in page.text
    assert "Scenario as resolved" in page.text


def test_commands_and_cards_of_many_runs(run):
    command = "pfsc run a --set 'b=<1>'"
    page = Page(
        report_page(**run, kind="Sweep", commands={"Worst <run>": command}, cards=["peak_torque_1"])
    )
    assert "Sweep" in page.text
    assert "Simulation run" not in page.text
    assert "Runs to look at" in page.text
    assert command in page.text
    assert "Worst <run>" in page.text
    assert [attributes.get("class") for tag, attributes in page.tags].count("card") == 1


def test_tables_have_their_words_and_numbers(run):
    table = Table("Base", "What <each> is.", ["name", "mean"], [["m_<1>", 1.23456], ["x", -2e-7]])
    html = report_page(**run, tables=[table], details="Base parameters in full")
    text = Page(html).text
    for words in ("Base.", "What <each> is.", "m_<1>", "Base parameters in full"):
        assert words in text
    assert '<td class="number">1.235</td>' in html
    assert '<td class="number">-2e-07</td>' in html


def test_columns_of_numbers_have_their_heads_above_them(run):
    table = Table("Base", "What.", ["name", "mean", "note"], [["m", 1.0, "x"], ["n", 2.0, "y"]])
    html = report_page(**run, tables=[table])
    assert '<tr><th>name</th><th class="number">mean</th><th>note</th></tr>' in html
    html = report_page(**run, tables=[Table("Base", "What.", ["name", "mean"], [])])
    assert "<tr><th>name</th><th>mean</th></tr>" in html


def test_a_metric_keeps_its_heads_where_the_table_is_stacked(run):
    page, html = read(report_page(**run))
    heads = page.values("td", "data-head")
    assert heads == ["Target", "Source"] * 3
    assert "content: attr(data-head)" in html


def test_a_brief_page_folds_metrics_and_further_figures(run):
    """Unfolded remain the key results and four figures; the scenario is reduced to its changes."""
    run["figures"] = [Figure(f"f{i}", f"Figure <{i}>", "c", PNG) for i in range(6)]
    html = report_page(**run, brief=True, changed_yaml_text="law: <rigid>\n")
    page = Page(html)
    folds = html.split("<details")[1:]
    assert [fold.partition("</details>")[0].count("<img") for fold in folds] == [2, 0, 0]
    assert "2 more: Figure <4>; Figure <5>" in page.text
    assert "3 metrics" in folds[1]
    assert "peak_torque_1" not in html.split("<details")[0]
    assert " open" not in "".join(fold.partition(">")[0] for fold in folds)
    assert "law: <rigid>" in page.text.split("Scenario as resolved")[0]
    assert html.count("<img") == 6
    open_page = report_page(**run)
    assert open_page.count("<details") == open_page.count(" open>") + 1 == 2


def test_facts_are_cards_beside_those_of_metrics(run):
    page, html = read(report_page(**run, facts=[Fact("Duration", "4.03 s", "of <5> s")]))
    assert html.count('class="card"') == 3
    assert "of <5> s" in page.text
    assert "required: <\u202f50\u202fµm" in page.text
    page, html = read(report_page(title="x", facts=[Fact("Duration", "0 s")]))
    assert html.count('class="card"') == 1


def test_legend_of_the_recording_has_colours(run):
    legend = {"path <1>": "#2666d9"}
    page, html = read(report_page(**run, legend=legend, recording="recording.html"))
    assert "path <1>" in page.text
    assert 'style="background: #2666d9"' in html
    assert "swatch" not in report_page(**run, legend=legend).partition("</head>")[2]


def test_commands_have_a_title(run):
    page = Page(report_page(**run, commands={"again": "pfsc run x"}, commands_title="Go on"))
    assert "Go on" in page.text
    assert "Runs to look at" not in page.text
