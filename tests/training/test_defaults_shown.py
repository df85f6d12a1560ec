"""What the wizard says of defaults, and how its ranges are put back."""

from __future__ import annotations

import pytest

from paddock.rules.hyperparameters import HYPERPARAMETERS


def test_the_consoles_defaults_stand_beside_ours_with_a_word_on_each_that_differs():
    for one in HYPERPARAMETERS.values():
        assert one.console.keys() == one.usual.keys()
        assert bool(one.why) == (dict(one.console) != dict(one.usual)), one.name
        assert all(one.fits(value) or one.name == "num_epochs" for value in one.console.values())


@pytest.mark.django_db
@pytest.mark.parametrize(("step", "speeds"), [("ranges", ("0.5", "2")), ("bounds", ("0.1", "4"))])
def test_a_button_puts_the_ranges_back_without_a_script(client, alice, step, speeds):
    client.force_login(alice)
    page = client.post("/train/new/", {"do": step, "action_space_type": "continuous", "speed_low": "3", "name": "kept"})
    form = page.context["form"]
    assert page.status_code == 200 and not form.errors and form["name"].value() == "kept"
    assert (form["speed_low"].value(), form["speed_high"].value()) == speeds
    assert (form["steering_low"].value(), form["steering_high"].value()) == ("-30", "30")
    assert "Console defaults" in page.content.decode()
