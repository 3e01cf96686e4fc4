"""Checks of the links of a built site: each target is a page, an anchor or a file that exists.

python -m docs.making.site_links out/site
"""

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# attributes that a page loads by itself, unlike links that a reader follows
_LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}


class _Page(HTMLParser):
    """Anchors and links of a page.

    Attributes:
        anchors: Names of the anchors.
        links: Tag and address of every link.
    """

    def __init__(self) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store the anchors and links of a tag."""
        values = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := values.get(key))}
        for key in ("href", "src"):
            if values.get(key):
                self.links.append((tag, values[key] or ""))


@cache
def _page(file: Path) -> _Page:
    page = _Page()
    page.feed(file.read_text(encoding="utf-8"))
    return page


def broken_links(site: Path) -> list[str]:
    """Return the broken links of a site, one line each.

    Args:
        site: Folder with the built pages.
    """
    found = []
    for file in sorted(site.rglob("*.html")):
        if "_static" in file.relative_to(site).parts:
            continue
        for tag, link in dict.fromkeys(_page(file).links):
            wrong = _fault(file, tag, link)
            if wrong:
                found.append(f"{file.relative_to(site)}: {link}: {wrong}")
    return found


def _fault(file: Path, tag: str, link: str) -> str | None:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        web = parts.scheme in ("http", "https") or bool(parts.netloc)
        return "is loaded from the network" if web and tag in _LOADED else None
    target = file if not parts.path else (file.parent / unquote(parts.path)).resolve()
    if not target.is_file():
        return "no such file"
    anchor = unquote(parts.fragment)
    if anchor and target.suffix == ".html" and anchor not in _page(target).anchors:
        return "no such anchor on the page"
    return None


if __name__ == "__main__":
    faults = broken_links(Path(sys.argv[1]).resolve())
    sys.exit("\n".join(faults) if faults else 0)
