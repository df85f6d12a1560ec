"""``manage.py doctor``: prints what an installation has, what is missing, and the remedy."""

import json
import sys
from argparse import ArgumentParser
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from config.operations.doctor import FAIL, OK, WARN, Finding, examine
from core.management.base import JsonCommand
from evaluation.running.proof import prove
from evaluation.sandbox.probe import probe
from paddock.simulator.engine import ENGINE_ID


class Command(JsonCommand):
    """Exit status 1 when models may not run here or results differ, or when database or files cannot be used."""

    help = (
        "Show the sandbox's layers, golden runs, broker, database, storage and versions. Exit status 1: something "
        "needed is missing."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--json", action="store_true", help="print the findings as JSON")

    def handle(self, **options: Any) -> None:
        report = probe()
        proof = prove() if report.sufficient else None
        findings = examine(report, proof)
        failed = any(finding.status == FAIL for finding in findings)
        if options["json"]:
            document = {
                "healthy": not failed,
                "sandbox": report.to_dict(),
                "proof": proof.to_dict() if proof else None,
                "engine": ENGINE_ID,
                "findings": [asdict(finding) for finding in findings],
            }
            self.stdout.write(json.dumps(document, indent=2))
        else:
            self._table(findings, failed)
        if failed:
            sys.exit(1)

    def _table(self, findings: list[Finding], failed: bool) -> None:
        styles: dict[str, Callable[[str], str]] = {
            OK: self.style.SUCCESS,
            WARN: self.style.WARNING,
            FAIL: self.style.ERROR,
        }
        width = max(len(finding.name) for finding in findings)
        area = None
        for finding in findings:
            if finding.area != area:
                area = finding.area
                self.stdout.write(f"\n{area}")
            self.stdout.write(
                f"  {styles[finding.status](f'{finding.status:<4}')}  {finding.name:<{width}}  {finding.detail}"
            )
        self.stdout.write("")
        self.stdout.write("Something that Paddock needs is missing." if failed else "Paddock can run here.")
