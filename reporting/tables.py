"""Tables of a page, on the terminal."""

from rich.console import Console
from rich.markup import escape
from rich.table import Table as TerminalTable

from reporting.page import Table


def print_table(console: Console, table: Table, most: int | None = None) -> None:
    """Print a table.

    Args:
        console: Where.
        table: Which.
        most: Rows to print at most; None for all.
    """
    shown = TerminalTable(title=table.title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    numbers = {k for row in table.rows for k, cell in enumerate(row) if not isinstance(cell, str)}
    for k, name in enumerate(table.head):
        shown.add_column(name, justify="right" if k in numbers else "left")
    for row in table.rows[:most]:
        shown.add_row(*(escape(x) if isinstance(x, str) else f"{x:.4g}" for x in row))
    console.print(shown)
    if most is not None and len(table.rows) > most:
        console.print(f"... {len(table.rows) - most} more on the page", style="dim")
    console.print()
