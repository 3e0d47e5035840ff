"""Puts the tables that are kept into the pages of docs/ that show them, each after the line <!-- its name -->.

python experiments/pages.py
"""

from __future__ import annotations

import re
from pathlib import Path

import table3
from columns import RESULTS

DOCS = Path(__file__).parents[1] / "docs"


def shown(page: str, tables: dict[str, str]) -> str:
    """The page with the tables (Markdown, by name) as they are now; a table without a mark is not shown."""
    for name, table in tables.items():
        page = re.sub(rf"(?<=<!-- {re.escape(name)} -->\n\n)(\|.*\n)*", table.replace("\\", r"\\"), page)
    return page


def main() -> None:
    kept = table3.tables(RESULTS / "default" / "table3")
    tables = {table.name: table.markdown().partition("\n\n")[2] for table in kept}  # the page has its own headings
    page = DOCS / "whole_rooms.md"
    page.write_text(shown(page.read_text(encoding="utf-8"), tables), encoding="utf-8")


if __name__ == "__main__":
    main()
