// The speed control of a car: a slider beside the number, in the range of the mode, with presets of a factor.
"use strict";

(() => {
  const form = document.querySelector("[data-speed]");
  if (!form) return;
  const mode = form.elements.mode;
  const value = form.elements.value;
  const slider = form.querySelector("#speed-slider");
  const MIDDLE = { multiplier: 1, cap: 2, absolute: 2, percent_max: 50, offset: 0, model_speed: 0 };

  const ranged = (fresh) => {
    const range = form.querySelector(`[data-range="${mode.value}"]`);
    const step = mode.value === "percent_max" ? "0.5" : "0.05";
    slider.min = range.dataset.least;
    slider.max = range.dataset.most;
    slider.step = step;
    value.min = range.dataset.least;
    value.max = range.dataset.most;
    if (fresh || value.value === "") value.value = MIDDLE[mode.value];
    slider.value = value.value;
    const none = mode.value === "model_speed";
    slider.closest("[data-slider]").hidden = none;
    value.readOnly = none;
  };

  mode.addEventListener("change", () => ranged(true));
  value.addEventListener("input", () => { slider.value = value.value; });
  slider.addEventListener("input", () => { value.value = slider.value; });
  const presets = form.querySelector("[data-presets]");
  presets.hidden = false;
  presets.addEventListener("click", (event) => {
    const preset = event.target.closest("[data-preset]");
    if (!preset) return;
    mode.value = "multiplier";
    ranged(true);
    value.value = preset.dataset.preset;
    slider.value = preset.dataset.preset;
  });
  ranged(false);
})();
