"""Links of a built site: each leads to a page, a place on it, or a file that is there.

python -m docs.making.site_links out/site
"""

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# what a page loads by itself, unlike what a reader may follow
_LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}


class _Page(HTMLParser):
    """Places of a page that can be linked to, and where its links lead.

    Attributes:
        places: Names of the places.
        links: Tag and address of every link.
    """

    def __init__(self) -> None:
        super().__init__()
        self.places: set[str] = set()
        self.links: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what a tag defines and refers to."""
        given = dict(attrs)
        self.places |= {value for key in ("id", "name") if (value := given.get(key))}
        for key in ("href", "src"):
            if given.get(key):
                self.links.append((tag, given[key] or ""))


@cache
def _page(file: Path) -> _Page:
    page = _Page()
    page.feed(file.read_text(encoding="utf-8"))
    return page


def broken_links(site: Path) -> list[str]:
    """Return what is wrong with the links of a site, one line each.

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
    place = unquote(parts.fragment)
    if place and target.suffix == ".html" and place not in _page(target).places:
        return "no such place on the page"
    return None


if __name__ == "__main__":
    faults = broken_links(Path(sys.argv[1]).resolve())
    sys.exit("\n".join(faults) if faults else 0)
