"""Writes the tables of all cells that are kept, and puts each into the pages that show it, after the line
<!-- its name -->.

    python experiments/pages.py
"""

from __future__ import annotations

import re
from pathlib import Path

import real_rooms
import table1
import table2
import table3
from kept import RESULTS, parser_of
from printing import Table, write

from layoutrl.runs.commands import answers_errors

ROOT = Path(__file__).parents[1]
KEPT = RESULTS / "default"
PAGES = ("README.md", "docs/results.md", "docs/planit.md", "docs/whole_rooms_results.md")


def shown(page: str, tables: dict[str, str]) -> str:
    """Return the page with its tables replaced by these (Markdown, by name); a table without a mark is not shown."""
    for name, table in tables.items():
        page = re.sub(rf"(?<=<!-- {re.escape(name)} -->\n\n)(\|.*\n)*", table.replace("\\", r"\\"), page)
    return page


def kept() -> dict[str, list[Table]]:
    """All tables of the cells that are kept, by the name of their Markdown file."""
    return {
        "table1": table1.tables(KEPT / "table1"),
        "table2": table2.tables(RESULTS / "scene" / "table2", KEPT / "table1"),
        "table3": table3.tables(KEPT / "table3"),
        "real": real_rooms.tables(KEPT / "real"),
    }


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.parse_args()  # so that --help writes nothing
    tables: dict[str, str] = {}
    for name, those in kept().items():
        write(those, KEPT / name)
        # Pages have headings of their own.
        tables |= {table.name: table.markdown().partition("\n\n")[2] for table in those}
    for page in (ROOT / name for name in PAGES):
        page.write_text(shown(page.read_text(encoding="utf-8"), tables), encoding="utf-8")


if __name__ == "__main__":
    main()
