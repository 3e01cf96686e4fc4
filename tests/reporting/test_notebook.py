"""Display in a notebook: no user text is taken for HTML, and long pages stay files."""

import math

import pytest

from reporting.metrics import Metric
from reporting.notebook import in_notebook, metrics_table, page_frame, short_table


def test_a_test_is_no_notebook():
    assert not in_notebook()


def test_text_is_no_html():
    table = short_table("<a>", ["<b>"], ["<c>"], {"<d>": Metric(1.0, "<e>", "<f>")})
    for letter in "abcdf":
        assert f"&lt;{letter}&gt;" in table
        assert f"<{letter}>" not in table.replace("<b>&lt;a&gt;</b>", "")


def test_targets_are_shown_first_and_what_was_not_reached_is_not_judged():
    metrics = {
        "peak_speed": Metric(2.0, "m/s"),
        "max_path_deviation": Metric(2e-5, "m", "< 1e-5"),
        "settling_time": Metric(math.nan, "s", "< 1"),
    }
    shown, folded = short_table("run", [], [], metrics).split("<details>")
    assert "run</b>: completed" in shown
    assert "✗ missed" in shown.split("settling_time")[0]
    assert "missed" not in shown.split("settling_time")[1]
    assert "1 more metrics" in folded
    assert "peak_speed" in folded
    assert "peak_speed" not in shown
    assert metrics_table(metrics).count("<tr") == 1 + len(metrics)
    assert metrics_table(metrics, []).count("<tr") == 1


@pytest.mark.parametrize(("folder", "is_file"), [("a b", True), ("../elsewhere", False)])
def test_a_page_beneath_the_notebook_stays_a_file(tmp_path, monkeypatch, folder, is_file):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    page = here / folder / "page.html"
    page.parent.mkdir()
    page.write_text('<p title="x">', encoding="utf-8")
    frame = page_frame(page, 200, '"')
    assert 'title="&quot;"' in frame
    assert ('src="a%20b/page.html"' in frame) == is_file
    assert ('srcdoc="&lt;p title=&quot;x&quot;&gt;"' in frame) != is_file
