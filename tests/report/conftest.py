from __future__ import annotations

from typing import Any

import pytest

from harness.report import render
from tests.report.page import Page
from tests.report.samples import mixed, results


@pytest.fixture(scope="session")
def agreeing() -> dict[str, Any]:
    return results()


@pytest.fixture(scope="session")
def troubled() -> dict[str, Any]:
    return mixed()


@pytest.fixture(scope="session")
def page(agreeing: dict[str, Any]) -> Page:
    return Page(render(agreeing))


@pytest.fixture(scope="session")
def troubled_page(troubled: dict[str, Any]) -> Page:
    return Page(render(troubled))
