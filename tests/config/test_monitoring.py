"""The dashboard and the alert rules name metrics and labels that there are, and each rule fires."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import pytest
import yaml

from core.metrics import DECLARED
from tests.docs.metric_table import rows
from tests.docs.pages import section, text
from tests.shared import CHECKOUT

MONITORING = CHECKOUT / "monitoring"
DASHBOARD = json.loads((MONITORING / "dashboard.json").read_text())
(GROUP,) = yaml.safe_load((MONITORING / "alerts.yml").read_text())["groups"]
ALERTS = {rule["alert"]: rule for rule in GROUP["rules"]}
OF_PANELS = {target["expr"]: panel["title"] for panel in DASHBOARD["panels"] for target in panel["targets"]}
EXPRESSIONS = {**OF_PANELS, **{rule["expr"]: name for name, rule in ALERTS.items()}}
OF_PROMETHEUS = {"le", "job", "instance"}
INFINITE = 'le="+Inf"'
PROMTOOL = shutil.which("promtool")
needs_promtool = pytest.mark.skipif(PROMTOOL is None, reason="promtool is missing (Debian: prometheus)")


def samples() -> dict[str, set[str]]:
    """The names of samples in a scrape, with their labels."""
    rows()  # imports all that counts
    found = {}
    for name, metric in DECLARED.items():
        suffixes = ("_bucket", "_count", "_sum") if metric.type == "histogram" else ("",)
        found |= {name + suffix: {*metric.labels, *OF_PROMETHEUS} for suffix in suffixes}
    return found


def selectors(expression: str) -> list[tuple[str, str]]:
    """The metrics in an expression, each with its matchers."""
    return re.findall(r"\b(paddock_\w+|up)(?:\{([^}]*)\})?", expression)


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=EXPRESSIONS.get)
def test_an_expression_names_samples_and_labels_that_there_are(expression):
    known, labels = samples(), set()
    for name, matchers in selectors(expression):
        if name != "up":
            assert name in known
            labels |= known[name]
            assert set(re.findall(r"(\w+)(?:=|!)", matchers)) <= known[name]
    for grouped in re.findall(r"by \(([^)]*)\)", expression):
        assert set(re.split(r",\s*", grouped)) <= labels


def test_every_metric_is_on_the_dashboard():
    shown = {re.sub("_(bucket|count|sum)$", "", name) for one in OF_PANELS for name, _ in selectors(one)}
    rows()
    assert shown == set(DECLARED)


def test_panels_have_ids_and_titles_of_their_own_and_legends_of_known_labels():
    panels = DASHBOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len({panel["title"] for panel in panels}) == len(panels)
    for target in (target for panel in panels for target in panel["targets"]):
        left = {"instance", *re.findall(r"\w+", " ".join(re.findall(r"by \(([^)]*)\)", target["expr"])))}
        assert set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"])) <= left


def test_every_alert_is_described_with_what_to_do():
    described = section(text("operators.md"), "## Metrics and logs")
    assert re.findall(r"^\| `(Paddock\w+)` \|", described, re.M) == list(ALERTS)


def test_every_alert_has_a_unit_test_that_fires_it():
    cases = yaml.safe_load((MONITORING / "alerts_test.yml").read_text())["tests"]
    fired = {one["alertname"] for case in cases for one in case.get("alert_rule_test", ()) if one["exp_alerts"]}
    assert fired == set(ALERTS)


@needs_promtool
@pytest.mark.parametrize(
    "words", ["check rules alerts.yml", "check config prometheus.yml", "test rules alerts_test.yml"]
)
def test_promtool_agrees(words):
    done = subprocess.run([PROMTOOL, *words.split()], cwd=MONITORING, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@needs_promtool
def test_promtool_lints_every_metric(tmp_path):
    """Names, help and types, as Prometheus' own linter wants them."""
    rows()
    lines = []
    for name, metric in DECLARED.items():
        lines += [f"# HELP {name} {metric.meaning}", f"# TYPE {name} {metric.type}"]
        labels = [f'{label}="x"' for label in metric.labels]
        suffixes = ("_sum", "_count") if metric.type == "histogram" else ("",)
        if metric.type == "histogram":
            lines.append(f"{name}_bucket{{{','.join([*labels, INFINITE])}}} 1")
        lines += [f"{name}{suffix}{{{','.join(labels)}}} 1" for suffix in suffixes]
    done = subprocess.run([PROMTOOL, "check", "metrics"], input="\n".join(lines) + "\n", capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
