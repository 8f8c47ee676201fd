"""Links of the built site: those within it must lead somewhere, those out of it are listed.

python docs/links.py site               # broken ones, a line each, and exit status 1
python docs/links.py site --external    # every address outside, which nothing here visits
"""

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADS = {
    "a": "href",
    "area": "href",
    "link": "href",
    "img": "src",
    "script": "src",
    "source": "src",
}


class Page(HTMLParser):
    """What a page links to or loads, and the anchors that it has."""

    def __init__(self, path: Path) -> None:
        """Read the page at `path`."""
        super().__init__()
        self.targets, self.anchors = [], {"", "top"}
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Keep a link's target and an element's name."""
        found = dict(attributes)
        self.anchors |= {found[key] for key in ("id", "name") if found.get(key)}
        if found.get(LOADS.get(tag, "")):
            self.targets.append(found[LOADS[tag]])


@cache
def page(path: Path) -> Page:
    """Return the page at `path`, read once."""
    return Page(path)


def is_external(target: str) -> bool:
    """Whether a target names a scheme or a host: `https://...`, `//host/...`, `mailto:...`."""
    parts = urlsplit(target)
    return bool(parts.scheme or parts.netloc)


def broken(site: Path) -> list[str]:
    """Each link that leads nowhere: a missing file, a missing anchor, an address without a host."""
    found = []
    for path in sorted(site.rglob("*.html")):
        for target in sorted(set(page(path).targets)):
            parts = urlsplit(target)
            if is_external(target):
                if parts.scheme not in ("https", "http", "mailto", "data") or (
                    parts.scheme.startswith("http") and "." not in parts.netloc
                ):
                    found.append(f"{path.relative_to(site)}: {target}: no address")
                continue
            to = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if to.is_dir():
                to /= "index.html"
            if not to.is_file():
                found.append(f"{path.relative_to(site)}: {target}: no such file")
            elif to.suffix == ".html" and unquote(parts.fragment) not in page(to).anchors:
                found.append(f"{path.relative_to(site)}: {target}: no such anchor")
    return found


def external(site: Path) -> list[str]:
    """Every address outside the site, once."""
    targets = {target for path in site.rglob("*.html") for target in page(path).targets}
    return sorted(t for t in targets if is_external(t) and not t.startswith("data:"))


def main(arguments: list[str]) -> int:
    """List what is broken, or with --external what lies outside; 1 where something is broken."""
    site = Path(arguments[0])
    if "--external" in arguments:
        print("\n".join(external(site)))
        return 0
    found = broken(site)
    print(
        "\n".join(found)
        if found
        else f"links: all within the site lead somewhere, {len(external(site))} go out of it"
    )
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
