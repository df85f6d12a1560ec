"""From the wizard to the board in a real browser, on the whole stack: site, workers, sandbox, trainer, simulator."""

from __future__ import annotations

import re
from time import monotonic

import pytest

from tests.pages.browsing import IN_A_BROWSER
from tests.pages.test_browser import DRIVE_MS, browser, page, playwright, sign_up

pytest.importorskip("torch", reason="training is not installed (make training)")
pytest.importorskip("stable_baselines3", reason="training is not installed (make training)")

__all__ = ["browser", "page"]
TRAIN_MS = 90_000
pytestmark = IN_A_BROWSER


def write(page: playwright.Page, code: str) -> None:
    """Replace what the editor holds."""
    editor = page.locator("[data-reward-editor]")
    editor.evaluate("(element, text) => element.editor.fill(text)", code)


def test_a_learner_trains_evaluates_and_reaches_a_board(page: playwright.Page) -> None:
    sign_up(page, "learner")
    began = monotonic()

    # the wizard: a mistake is marked in its line before anything is trained
    page.goto("/")
    page.get_by_role("link", name="Train", exact=True).click()
    page.get_by_role("link", name="Create a model").first.click()
    page.get_by_label("Name").fill("First-car")
    write(page, "def reward_function(params):\n    return params['no such key']\n")
    page.get_by_role("button", name="Validate").click()
    problems = page.locator(".problems")
    playwright.expect(problems).to_contain_text("Line 2 of the reward function failed", timeout=DRIVE_MS)
    assert problems.inner_text().count("Line 2") == 1
    playwright.expect(page.locator(".cm-lintRange-error")).to_have_count(1)
    page.locator("[data-examples]").select_option(label="Follow the centre line")
    page.get_by_role("button", name="Validate").click()
    playwright.expect(page.locator("[data-report]")).to_contain_text("No problems found", timeout=DRIVE_MS)

    # the table follows its granularities, the sector of the ranges can be dragged
    page.get_by_label("Steering angles").select_option("7")
    playwright.expect(page.locator("[data-fan='discrete'] .fan-ray")).to_have_count(7)
    page.get_by_label("Steering angles").select_option("5")
    page.get_by_label("ranges (continuous)").check()
    handle = page.locator("[data-fan='continuous'] .fan-handle").nth(1)
    handle.scroll_into_view_if_needed()
    handle = handle.bounding_box()
    x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y - 30)
    page.mouse.up()
    steering = float(page.get_by_role("spinbutton", name="Steering to the left").input_value())
    assert steering < 30
    page.keyboard.press("ArrowRight")
    assert float(page.get_by_role("spinbutton", name="Steering to the left").input_value()) == steering - 1
    page.get_by_label("a table of actions").check()

    # what nobody has changed follows the algorithm
    epochs, rate = page.locator("[name=num_epochs]"), page.locator("[name=lr]")
    rate.evaluate("field => { field.value = '0.0003'; }")
    page.locator("[name=algorithm][value=sac]").check(force=True)
    assert (epochs.input_value(), rate.input_value()) == ("6", "0.0003")
    page.locator("[name=algorithm][value=ppo]").check(force=True)
    assert (epochs.input_value(), rate.input_value()) == ("4", "0.0003")
    rate.evaluate("field => { field.value = '0.001'; }")

    # all at once: the console's values beside ours, and back
    page.get_by_text("Console defaults and ours").click()
    page.get_by_role("button", name="Use AWS console defaults").click()
    assert (epochs.input_value(), rate.input_value()) == ("10", "0.0003")
    page.get_by_role("button", name="Use Paddock defaults").click()
    assert (epochs.input_value(), rate.input_value()) == ("4", "0.001")

    # it trains: the graph grows without a reload, the car drives
    page.get_by_role("button", name="Create and train").click()
    playwright.expect(page.get_by_role("heading", name="First-car")).to_be_visible(timeout=DRIVE_MS)
    page.evaluate("window.sameDocument = true")
    playwright.expect(page.locator(".graph-dots").first).to_be_visible(timeout=TRAIN_MS)
    points = page.locator("svg.graph").get_attribute("data-points").count("[")
    playwright.expect(page.locator("svg.graph")).not_to_have_attribute(
        "data-points", re.compile(rf"^(?:[^\[]*\[){{{points}}}[^\[]*$"), timeout=TRAIN_MS
    )
    playwright.expect(page.locator("#training-state")).to_have_text("training")
    playwright.expect(page.locator("[data-drive-car]")).to_have_attribute("transform", re.compile("translate"))
    page.locator("svg.graph").hover()
    playwright.expect(page.locator("[data-tip]")).to_contain_text("Iteration")
    assert page.evaluate("window.sameDocument")

    # stopped, it leaves its model
    page.get_by_role("button", name="Stop the training").click()
    playwright.expect(page.locator("#training-state")).to_have_text("stopped", timeout=DRIVE_MS)
    playwright.expect(page.locator("#after")).to_contain_text("First-car", timeout=DRIVE_MS)
    with page.expect_download() as download:
        page.get_by_role("link", name="Best model (ONNX package)").click()
    assert download.value.suggested_filename == "First-car.zip"

    page.get_by_role("button", name="Evaluate: three laps").click()
    playwright.expect(page.get_by_role("heading", name="Laps", exact=True)).to_be_visible(timeout=DRIVE_MS)

    page.goto("/train/")
    page.get_by_role("link", name="First-car").click()
    race = page.locator("#after .send-list li").first
    board = race.get_by_role("link").get_attribute("href")
    race.get_by_role("button", name="Submit").click()
    page.goto(board)
    playwright.expect(page.locator("#live-card .pill")).to_have_text("finished", timeout=DRIVE_MS)
    playwright.expect(page.locator("table.board tr.me")).to_contain_text("learner", timeout=DRIVE_MS)
    assert monotonic() - began < 120


@pytest.mark.soak  # the button is pressed in test_forms_browser.py, and does what it should in test_first_car.py
def test_one_click_brings_a_newcomer_onto_the_beginners_board(page: playwright.Page) -> None:
    sign_up(page, "clicker")
    steps = page.locator("#steps")
    playwright.expect(steps).to_contain_text("0 of 4 done")
    steps.get_by_role("button", name="Train my first car").click()
    playwright.expect(page.get_by_role("heading", name="first-car")).to_be_visible(timeout=DRIVE_MS)
    page.get_by_role("link", name="Submitted to First laps on the oval").click(timeout=TRAIN_MS)

    # the run says first what ranks, and the place
    worth = page.locator("#worth")
    playwright.expect(worth).to_contain_text("Best lap", timeout=DRIVE_MS)
    playwright.expect(worth).to_contain_text("Your first result in this race.")
    playwright.expect(worth).to_contain_text(re.compile(r"Place\s*\d+ of \d+"))
    page.get_by_role("link", name="To the board").click()
    playwright.expect(page.locator("table.board tr.me .place")).to_have_text(re.compile(r"^\d+$"))

    # with this one car sent, the race leads to another; the steps have ticked themselves off
    playwright.expect(page.get_by_role("link", name="Train or upload another")).to_be_visible()
    playwright.expect(page.locator("#send")).to_contain_text("Train one for this race")
    page.goto("/")
    playwright.expect(steps).to_contain_text("3 of 4 done")
