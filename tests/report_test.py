#!/usr/bin/env python3
"""`hpr compare --html`: one well-formed page that needs nothing else, and no page where something fails.

usage: report_test.py HPR
"""

import html.parser
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

HPR = str(pathlib.Path(sys.argv[1]).resolve())
VOID = {"meta", "br", "hr", "img", "link", "input"}
SVG = "{http://www.w3.org/2000/svg}"
COMPARE = ["compare", "--synthetic", "half", "--size", "320x200", "--frames", "2", "--warmup", "0"]
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)
        print(f"failed: {message}")


class Balance(html.parser.HTMLParser):
    """As a browser reads it: every element that is opened is closed, in order."""

    def __init__(self):
        super().__init__()
        self.open = []
        self.tags = []
        self.addresses = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in {"src", "href", "data", "srcset"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        expect(self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-1:]}")
        if self.open:
            self.open.pop()


def run(folder, *arguments):
    return subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=40, check=False)


def check_page(text, drawn, rows):
    reader = Balance()
    reader.feed(text)
    reader.close()
    expect(not reader.open, f"left open: {reader.open}")
    expect(not reader.addresses, f"refers to {reader.addresses}")
    for tag in ("script", "link", "img", "iframe", "object"):
        expect(tag not in reader.tags, f"has <{tag}>")
    expect("url(" not in text and "@import" not in text, "the style sheet loads something")
    page = ElementTree.fromstring(text)
    expect(len(page.findall(".//tbody/tr")) == rows, "one row per run")
    drawings = page.findall(f".//{SVG}svg")
    expect(len(drawings) == 2 + drawn, f"{len(drawings)} drawings for {drawn} strategies and 2 plots")
    for drawing in drawings:
        for part in ("title", "desc"):
            found = drawing.find(SVG + part)
            expect(found is not None and found.text, f"a drawing without <{part}>")
        width, height = (float(drawing.get(side)) for side in ("width", "height"))
        for line in drawing.findall(SVG + "line"):
            inside = all(0 <= float(line.get(x)) <= width for x in ("x1", "x2"))
            inside = inside and all(0 <= float(line.get(y)) <= height for y in ("y1", "y2"))
            expect(inside, f"a line leaves its paper in {drawing.find(SVG + 'title').text}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-report-") as scratch:
        folder = pathlib.Path(scratch)
        names = run(folder, *COMPARE, "--ranks", "1,2,5", "--html", "r.html", "--csv", "r.csv")
        expect(names.returncode == 0, f"left with {names.returncode}: {names.stderr}")
        csv = (folder / "r.csv").read_text().splitlines()[1:]
        strategies = {line.split(",")[0] for line in csv}
        expect(len(csv) == 3 * len(strategies) and len(strategies) >= 9, "every strategy ran on every count")
        page = (folder / "r.html").read_text()
        drawn = strategies - {"auto"}  # which says what it chose
        check_page(page, len(drawn), len(csv))
        expect("<p>It chose shared-memory.</p>" in page, "auto says what it chose")
        for name in drawn:
            expect(f"<h3>{name} on 5 ranks</h3>" in page, f"{name} is drawn on 5 ranks")
        expect(sorted(p.name for p in folder.iterdir()) == ["r.csv", "r.html"], "nothing else is left")

        again = run(folder, *COMPARE, "--ranks", "2", "--html", "r.html")
        expect(again.returncode == 4 and "--force" in again.stderr, "a report is not overwritten without --force")
        expect((folder / "r.html").read_text() == page, "a refused report stays as it was")
        forced = run(folder, *COMPARE, "--transport", "threads", "--ranks", "2", "--html", "r.html", "--force")
        expect(forced.returncode == 0, f"--force: left with {forced.returncode}")
        check_page((folder / "r.html").read_text(), len(drawn), len(strategies))

        hostile = "a<b>&\"'.glb"
        made = run(folder, "scene", "make", "tetra", "-o", hostile)
        expect(made.returncode == 0, f"scene make: left with {made.returncode}: {made.stderr}")
        drawn = run(folder, *["compare", hostile, *COMPARE[3:]], "--ranks", "2", "--strategies", "tree,sort-first", "--html", "h.html")
        expect(drawn.returncode == 0, f"hostile name: left with {drawn.returncode}: {drawn.stderr}")
        page = (folder / "h.html").read_text()
        check_page(page, 1, 2)
        expect(ElementTree.fromstring(page).find("head/title").text == f"hpr compare: {hostile}", "a name is shown as it is")

    with tempfile.TemporaryDirectory(prefix="hpr-report-") as scratch:
        folder = pathlib.Path(scratch)
        # So many frames would take days: it is found before any is measured.
        late = run(folder, *COMPARE[:-4], "--frames", "1000000", "--ranks", "2", "--html", "none/r.html")
        expect(late.returncode == 4 and "none" in late.stderr, f"unwritable: left with {late.returncode}")
        failed = run(folder, *COMPARE, "--ranks", "2", "--strategies", "radix-k:2,2", "--html", "r.html")
        expect(failed.returncode == 2, f"misfit: left with {failed.returncode}")
        scene = run(folder, "compare", "none.glb", "--ranks", "2", "--html", "r.html")
        expect(scene.returncode == 4, f"missing scene: left with {scene.returncode}")
        expect(not list(folder.iterdir()), "a run that fails leaves no file")

    print(f"{len(failures)} failed" if failures else "the report is whole")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
