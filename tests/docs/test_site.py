"""The site is built, its notebooks not executed; warnings and broken links are errors."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from docs.making.site_links import broken_links
from tests.docs.documents import PAGES, ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = ["-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", folder / "doctrees"]
    environment = os.environ | {"PFSC_NOTEBOOKS": "off"}
    done = subprocess.run(
        [sys.executable, *map(str, command), "docs", str(folder / "html")],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


@pytest.mark.slow
def test_every_document_is_a_page(site: Path) -> None:
    for file in PAGES:
        page = site / file.relative_to(ROOT / "docs").with_suffix(".html")
        assert page.is_file(), file
        assert "<!-- generated:" not in page.read_text(encoding="utf-8"), file


@pytest.mark.slow
def test_links(site: Path) -> None:
    assert broken_links(site) == []


def test_nothing_that_links_lead_to_is_missed(tmp_path: Path) -> None:
    (tmp_path / "other.html").write_text('<h1 id="there">Other</h1>', encoding="utf-8")
    (tmp_path / "index.html").write_text(
        '<a href="other.html#there">a</a> <a href="other.html#nowhere">b</a> '
        '<a href="none.html">c</a> '
        '<a href="#here">d</a> <p id="here"></p> <a href="https://drake.mit.edu">e</a>'
        '<script src="https://cdn.example/x.js"></script> <img src="//cdn.example/x.png">'
        '<img src="data:image/png;base64,AAAA">',
        encoding="utf-8",
    )
    assert broken_links(tmp_path) == [
        "index.html: other.html#nowhere: no such anchor on the page",
        "index.html: none.html: no such file",
        "index.html: https://cdn.example/x.js: is loaded from the network",
        "index.html: //cdn.example/x.png: is loaded from the network",
    ]
