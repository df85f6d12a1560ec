"""The table of metrics in docs/operators.md, written from the metrics themselves.

``python -m tests.docs.metric_table`` writes it after a metric was added or reworded.
"""

from __future__ import annotations

from importlib import import_module

from core.metrics import DECLARED
from tests.docs.pages import DOCS

THAT_COUNT = (
    *("config.middleware.request_metrics", "config.operations.metrics", "config.serving.streams.server"),
    *("evaluation.garage.services", "evaluation.running.queue.worker"),
)
PAGE = DOCS / "operators.md"
BEGIN, END = "<!-- metrics: begin -->", "<!-- metrics: end -->"


def rows() -> list[str]:
    """One row for each metric, in the order of their names."""
    for module in THAT_COUNT:
        import_module(module)
    lines = ["| metric | type | labels | meaning |", "|---|---|---|---|"]
    for name, metric in sorted(DECLARED.items()):
        labels = ", ".join(f"`{label}`" for label in metric.labels)
        lines.append(f"| `{name}` | {metric.type} | {labels} | {metric.meaning} |")
    return lines


def replaced(page: str) -> str:
    """``page`` with the present table."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{chr(10).join(rows())}\n{page[after:]}"


if __name__ == "__main__":
    import os

    import django

    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "tests.settings")
    django.setup()
    PAGE.write_text(replaced(PAGE.read_text()))
