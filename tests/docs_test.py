#!/usr/bin/env python3
"""What docs say about options is what the program says: tables are compared with what it prints.

usage: docs_test.py HPR ROOT [--write]

docs/cli.md holds `hpr help --markdown`, docs/knobs.md `hpr help knobs --markdown`, docs/quality.md `hpr help quality
--markdown`, docs/walls.md `hpr wall schema --markdown`, each between two marks. Every option of every
command's --help stands in docs/cli.md. --write puts the program's words into the files.
"""

import pathlib
import re
import sys

from program import expect, failures, run

GENERATED = {"cli.md": ["help", "--markdown"], "knobs.md": ["help", "knobs", "--markdown"],
             "quality.md": ["help", "quality", "--markdown"], "walls.md": ["wall", "schema", "--markdown"]}
OPTION = re.compile(r"^ {2}(?:-\w,)?(--[a-z-]+)", re.MULTILINE)
COMMAND = re.compile(r"^ {2}([a-z]+) {2,}", re.MULTILINE)


def with_generated(text, generated):
    """The file's text with the part that the program prints put in: what stands between two marks."""
    begin, end = "<!-- generated: ", "<!-- end of what is generated -->"
    head, _, rest = text.partition(begin)
    mark, _, rest = rest.partition("\n")
    _, _, tail = rest.partition(end)
    return f"{head}{begin}{mark}\n{generated}{end}{tail}"


def commands_below(folder, words):
    """Every command's words, ["wall", "run"]."""
    found = []
    page = run(folder, *words, "--help").stdout
    subcommands = page.partition("Subcommands:")[2]
    for name in COMMAND.findall(subcommands):
        found += commands_below(folder, [*words, name]) or [[*words, name]]
    return found


def main():
    root = pathlib.Path(sys.argv[2])
    for file, words in GENERATED.items():
        path = root / "docs" / file
        text = path.read_text()
        wanted = with_generated(text, run(root, *words).stdout)
        if "--write" in sys.argv:
            path.write_text(wanted)
        expect("--write" in sys.argv or text == wanted,
               f"docs/{file} is not what 'hpr {' '.join(words)}' prints: run tests/docs_test.py HPR ROOT --write")
    listed = (root / "docs" / "cli.md").read_text()
    commands = commands_below(root, [])
    expect(len(commands) > 20, f"only {len(commands)} commands found")
    for words in commands:
        name = " ".join(["hpr", *words])
        section = listed.partition(f"\n## `{name}`\n")[2].partition("\n## ")[0]
        if "[settings]" in section:
            section += listed.partition("\n## Settings\n")[2]
        section += listed.partition("\n## Everywhere\n")[2].partition("\n## ")[0]
        expect(section != "", f"docs/cli.md has no section on {name}")
        for option in OPTION.findall(run(root, *words, "--help").stdout):
            expect(option == "--help" or re.search(rf"`[^`]*{option}\b[^`]*`", section), f"docs/cli.md: {name} lacks {option}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
