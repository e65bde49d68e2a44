"""The panels of a report: each module of a package is a panel, and is discovered there."""

from collections import Counter
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Protocol, cast


class Panel(Protocol):
    """A module of ``pipelines.report.panels`` (of the run) or ``pipelines.report.unit_panels`` (of each unit).

    ORDER : panels are shown by it, ascending · TITLE : heading, empty for none
    """

    ORDER: int
    TITLE: str

    def render(self, context: Any, /) -> str | None:
        """The panel as HTML without its heading; None if this run, or unit, has no content for it."""
        ...


class IncompletePanel(Exception):
    """A module of a panel that is incomplete, or has the ORDER of another: its author must correct it."""


@cache
def panels(package: str) -> tuple[Panel, ...]:
    """The panels that the modules of a package are, in the order of the page.

    Raises
    ------
    IncompletePanel
        A module lacks ORDER, TITLE or ``render``, or two have one ORDER.
    """
    collected: list[Panel] = []
    for info in iter_modules(import_module(package).__path__):
        module = import_module(f"{package}.{info.name}")
        kinds = {"ORDER": int, "TITLE": str}
        missing = [name for name, kind in kinds.items() if not isinstance(getattr(module, name, None), kind)]
        missing += [] if callable(getattr(module, "render", None)) else ["render"]
        if missing:
            raise IncompletePanel(f"{package}.{info.name}: a panel without {', '.join(missing)}; add it")
        collected.append(cast("Panel", module))
    order, count = Counter(panel.ORDER for panel in collected).most_common(1)[0]
    if count > 1:
        raise IncompletePanel(f"{package}: {count} panels have the ORDER {order}; choose another number")
    return tuple(sorted(collected, key=lambda panel: panel.ORDER))


def rendered(package: str, context: Any) -> list[tuple[str, str]]:
    """Title and HTML of every panel with content."""
    shown = ((panel.TITLE, panel.render(context)) for panel in panels(package))
    return [(title, html) for title, html in shown if html is not None]
