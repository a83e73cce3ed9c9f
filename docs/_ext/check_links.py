"""Check a built site without a network: every link, anchor and picture leads to something.

    python docs/_ext/check_links.py docs/_build/html

Prints each broken link with its page and ends with 1 if there is one.
"""

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

OUTSIDE = ("http", "https", "mailto", "data", "javascript")


class Page(HTMLParser):
    """Links and anchors of one page.

    Attributes:
        links: targets of href and src, as written.
        anchors: every id and name that a link can point to.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in ("id", "name"):
                self.anchors.add(value)
            elif value and name in ("href", "src"):
                self.links.append(value)


def _pages(site: Path) -> list[Path]:
    """The pages of the site; what lies in `_static` is the theme's."""
    return [path for path in site.rglob("*.html") if "_static" not in path.parts]


def broken_links(site: Path) -> Iterator[str]:
    """One line for each link of the HTML pages below `site` that leads nowhere."""
    pages = {path.resolve(): Page(path.read_text("utf-8")) for path in _pages(site)}
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme in OUTSIDE or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            where = f"{path.relative_to(site.resolve())}: {link}"
            if not target.is_file():
                yield f"{where}: there is no such file"
            elif parts.fragment and target in pages and not _has(pages[target], parts.fragment):
                yield f"{where}: the page has no such anchor"


def _has(page: Page, fragment: str) -> bool:
    return unquote(fragment) in page.anchors | {"top"}


def main(arguments: list[str]) -> int:
    """Check the site in the folder named by the first argument; 1 if a link is broken."""
    site = Path(arguments[0])
    problems = sorted(set(broken_links(site)))
    pages = len(_pages(site))
    if not pages:
        problems = [f"{site}: no HTML pages, build the site first"]
    print("\n".join(problems) or f"links: {pages} pages, no broken link")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
