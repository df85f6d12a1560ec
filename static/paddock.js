// Improves every page beyond plain HTML, which works without it: theme, local times, countdowns, files and copying,
// with texts from data attributes for translation.
"use strict";

(() => {
  const root = document.documentElement;
  const language = root.lang || "en";
  const each = (selector, work, within = document) => within.querySelectorAll(selector).forEach(work);

  // --- theme: the server paints what the cookie says, so nothing flashes ---------------------------------------------
  const systemIsDark = () => matchMedia("(prefers-color-scheme: dark)").matches;
  each("[data-theme-form]", (form) => form.addEventListener("submit", (event) => {
    event.preventDefault();
    const dark = root.dataset.theme === "dark" || (root.dataset.theme !== "light" && systemIsDark());
    root.dataset.theme = dark ? "light" : "dark";
    const secure = location.protocol === "https:" ? "; Secure" : "";
    document.cookie = `theme=${root.dataset.theme}; Path=/; Max-Age=31536000; SameSite=Lax${secure}`;
  }));

  // --- times: the server writes its own time zone, the reader sees theirs --------------------------------------------
  // In the server's style (core/times.py): Sat 28 Nov, 14:32 CET; the year where it is another one.
  const two = { hour: "2-digit", minute: "2-digit", hourCycle: "h23" };
  const short = { weekday: "short", day: "numeric", month: "short", year: "numeric" };
  const parts = new Intl.DateTimeFormat(language, { ...short, ...two, timeZoneName: "short" });
  const written = (moment) => {
    const is = Object.fromEntries(parts.formatToParts(moment).map((part) => [part.type, part.value]));
    const isOld = moment.getFullYear() !== new Date().getFullYear();
    const day = language === "ko"
      ? `${isOld ? `${is.year}년 ` : ""}${moment.getMonth() + 1}월 ${is.day}일 (${is.weekday})`
      : `${is.weekday} ${is.day} ${is.month}${isOld ? ` ${is.year}` : ""},`;
    return `${day} ${is.hour}:${is.minute} ${is.timeZoneName}`;
  };
  const zone = Intl.DateTimeFormat().resolvedOptions().timeZone;
  if (zone && !document.cookie.split("; ").includes(`zone=${zone}`)) { // the server writes and reads times in it
    const secure = location.protocol === "https:" ? "; Secure" : "";
    document.cookie = `zone=${zone}; Path=/; Max-Age=31536000; SameSite=Lax${secure}`;
  }
  function showTime(element) {
    const moment = new Date(element.dateTime);
    if (Number.isNaN(moment.valueOf())) return;
    element.title = `${element.textContent.trim()} · ${zone}`;
    element.textContent = written(moment);
    element.removeAttribute("data-local");
  }
  function countDown(element) {
    const left = Math.floor((new Date(element.dateTime) - Date.now()) / 1000);
    if (left < 0) { element.textContent = element.dataset.over || ""; return; }
    const [d, h, m, s] = [Math.floor(left / 86400), Math.floor(left / 3600) % 24, Math.floor(left / 60) % 60, left % 60];
    const unit = (key, value) => (element.dataset[key] || "%s").replace("%s", value);
    const text = d ? `${unit("d", d)} ${unit("h", h)}` : h ? `${unit("h", h)} ${unit("m", m)}` : `${unit("m", m)} ${unit("s", s)}`;
    if (element.textContent !== text) element.textContent = text;
  }
  const refresh = (within = document) => {
    each("time[data-local]", showTime, within);
    each("time[data-countdown]", countDown, within);
  };
  refresh();
  setInterval(() => each("time[data-countdown]", countDown), 1000);
  document.addEventListener("htmx:afterSettle", () => refresh());
  document.addEventListener("paddock:fresh", ({ detail }) => refresh(detail));

  // --- an open track is driven from its start to its end or back, a loop by the clock ---------------------------------
  each("select[data-forth]", (select) => {
    const track = select.form && select.form.elements.track;
    if (!track || !track.options) return;
    const say = () => {
      const open = track.selectedOptions.length ? track.selectedOptions[0].dataset.open : "";
      for (const way of select.options) {
        way.text = !open ? way.dataset.usual : way.value === open ? select.dataset.forth : select.dataset.back;
      }
    };
    track.addEventListener("change", say);
    say();
  });

  // --- a field with a pattern names it in the page's language, not as "the requested format" ------------------------------
  document.addEventListener("invalid", ({ target }) => {
    if (target.title && target.validity.patternMismatch) target.setCustomValidity(target.title);
  }, true);
  document.addEventListener("input", ({ target }) => {
    if (target.title && target.pattern) target.setCustomValidity("");
  });

  // --- date fields: typed in the reader's time zone, which the hidden field names ------------------------------------
  const local = (moment) => new Date(moment - moment.getTimezoneOffset() * 60000).toISOString().slice(0, 16);
  each("form[data-zoned]", (form) => {
    const field = form.elements.time_zone;
    if (!field || field.value === zone || !zone) return;
    each("input[type='datetime-local'][data-utc]", (input) => {
      const moment = new Date(input.dataset.utc);
      if (!Number.isNaN(moment.valueOf())) input.value = local(moment);
    }, form);
    field.value = zone;
    each("[data-zone]", (element) => { element.textContent = zone; }, form);
  });

  // --- what scrolls sideways can be reached and scrolled by keyboard, as long as it does ------------------------------
  const scrollers = new ResizeObserver((seen) => seen.forEach(({ target }) => {
    if (target.scrollWidth > target.clientWidth + 1) target.tabIndex = 0;
    else target.removeAttribute("tabindex");
  }));
  const watchScrollers = () => each(".scroll, pre", (element) => {
    scrollers.observe(element);
    const heading = element.closest(":has(> h2), section, details")?.querySelector("h2, summary");
    if (!element.matches(".scroll") || element.hasAttribute("role") || !heading) return;
    element.setAttribute("role", "group"); // no landmark: its section is one already, by the same name
    element.setAttribute("aria-label", heading.textContent.trim());
  });
  watchScrollers();
  document.addEventListener("htmx:afterSettle", watchScrollers);

  // --- a track chosen by its picture: the list says so, and everything that hangs on it follows ------------------------
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("[data-choose-track]");
    const pictures = button && button.closest("[data-track-pictures]");
    if (!pictures) return;
    const list = pictures.closest("form").elements.track;
    list.value = button.dataset.chooseTrack;
    list.dispatchEvent(new Event("change", { bubbles: true }));
    pictures.open = false;
    list.focus();
  });
  document.addEventListener("htmx:afterSettle", ({ target }) => {
    const pictures = target.closest && target.closest("[data-track-pictures]");
    if (!pictures) return;
    const known = new Set([...pictures.closest("form").elements.track.options].map((option) => option.value));
    each("[data-of-track]", (card) => { card.hidden = !known.has(card.dataset.ofTrack); }, pictures);
  });

  // --- a row of a board on a narrow screen opens by a tap anywhere on it, as by its arrow ----------------------------------
  document.addEventListener("click", ({ target }) => {
    const more = target.closest("table.board tr")?.querySelector(".row-more");
    if (more && more.offsetParent && !target.closest("a, button, summary")) more.open = !more.open;
  });

  // --- menus close on Escape and on a click elsewhere ----------------------------------------------------------------
  document.addEventListener("click", (event) => each("details.menu[open]", (menu) => {
    if (!menu.contains(event.target)) menu.open = false;
  }));
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") each("details.menu[open]", (menu) => { menu.open = false; menu.firstElementChild.focus(); });
  });

  // --- a place to drop files: fills the ordinary file field ----------------------------------------------------------
  each("[data-drop]", (zoneElement) => {
    const input = zoneElement.querySelector("input[type='file']");
    const chosen = zoneElement.querySelector("[data-chosen]");
    const show = () => {
      const files = [...input.files].map((file) => `${file.name} (${(file.size / 1e6).toFixed(1)} MB)`);
      const size = [...input.files].reduce((sum, file) => sum + file.size, 0);
      const tooLarge = size > Number(zoneElement.dataset.limitMb) * 1024 * 1024;
      input.setCustomValidity(tooLarge ? zoneElement.dataset.tooLarge : "");
      chosen.textContent = files.join(" + ") + (tooLarge ? ` – ${zoneElement.dataset.tooLarge}` : "");
      chosen.classList.toggle("bad", tooLarge);
      chosen.hidden = !files.length;
    };
    input.addEventListener("change", show);
    for (const type of ["dragenter", "dragover"]) {
      zoneElement.addEventListener(type, (event) => { event.preventDefault(); zoneElement.classList.add("over"); });
    }
    for (const type of ["dragleave", "drop"]) {
      zoneElement.addEventListener(type, () => zoneElement.classList.remove("over"));
    }
    zoneElement.addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer.files.length) { input.files = event.dataTransfer.files; show(); }
    });
  });

  // --- a form that takes a while says so and is sent once ------------------------------------------------------------
  each("form[data-busy]", (form) => form.addEventListener("submit", () => {
    const button = form.querySelector("button[type='submit'], button:not([type])");
    if (!button) return;
    button.dataset.idle = button.textContent;
    button.textContent = form.dataset.busy;
    setTimeout(() => { button.disabled = true; });
  }));
  addEventListener("pageshow", () => each("button[data-idle]", (button) => {
    button.disabled = false;
    button.textContent = button.dataset.idle;
  }));

  // --- parts of a form that belong to one choice: the style sheet hides them, here they are not sent either -----------
  each("form:has([data-when])", (form) => {
    const sort = () => each("fieldset[data-when]", (part) => {
      const [name, values] = part.dataset.when.split("=");
      const chosen = form.querySelector(`[name="${name}"]:checked`);
      part.disabled = Boolean(chosen) && !values.split("|").includes(chosen.value);
    }, form);
    form.addEventListener("change", sort);
    addEventListener("pageshow", sort);
  });

  // --- rows of boxes: as many as are used, one more on demand --------------------------------------------------------
  each("[data-box-rows]", (list) => {
    const rows = [...list.querySelectorAll("[data-box-row]")];
    const more = list.querySelector("[data-box-add]");
    const fields = (row) => [...row.querySelectorAll("input, select")];
    const locked = more.disabled;
    const used = () => rows.filter((row) => fields(row)[0].value !== "").length;
    let shown = Math.max(1, used());
    const show = () => {
      rows.forEach((row, index) => {
        row.hidden = index >= shown;
        row.querySelector("[data-box-remove]").hidden = locked;
      });
      more.hidden = locked || shown >= rows.length;
    };
    more.addEventListener("click", () => {
      shown += 1;
      show();
      fields(rows[shown - 1])[0].focus();
    });
    rows.forEach((row, index) => row.querySelector("[data-box-remove]").addEventListener("click", () => {
      for (let next = index; next + 1 < rows.length; next += 1) {
        fields(rows[next]).forEach((field, which) => { field.value = fields(rows[next + 1])[which].value; });
      }
      fields(rows[rows.length - 1])[0].value = "";
      shown = Math.max(1, shown - 1);
      show();
      fields(rows[Math.min(index, shown - 1)])[0].focus();
      list.dispatchEvent(new Event("change", { bubbles: true }));
    }));
    list.addEventListener("paddock:box", ({ detail: { percent, lane, near } }) => {
      if (locked) return;
      const there = rows.findIndex((row) => near(fields(row)[0].value, fields(row)[1].value));
      if (there >= 0) {
        rows[there].querySelector("[data-box-remove]").click();
        return;
      }
      const free = rows.findIndex((row) => fields(row)[0].value === "");
      if (free < 0) return;
      [percent, lane].forEach((value, which) => { fields(rows[free])[which].value = value; });
      shown = Math.max(shown, free + 1);
      show();
      list.dispatchEvent(new Event("change", { bubbles: true }));
    });
    show();
  });

  // --- a click on the map puts a box there, in the lane that is nearest; a click on a box takes it away -----------------
  document.addEventListener("click", (event) => {
    const map = event.target.closest("[data-places]");
    const list = map && map.closest("form").querySelector("[data-box-rows]");
    if (!list) return;
    const drawing = map.querySelector("svg");
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    const places = JSON.parse(map.dataset.places);
    const metres = ([x, y]) => Math.hypot(x - at.x, y - at.y);
    let best = { far: 1 };
    Object.entries(places).forEach(([lane, points]) => points.forEach((point, index) => {
      if (metres(point) < best.far) best = { far: metres(point), lane, percent: 100 * index / points.length };
    }));
    if (!best.lane) return;
    const near = (percent, lane) => {
      const points = places[lane];
      const point = percent !== "" && points[Math.round(percent / 100 * points.length) % points.length];
      return Boolean(point) && metres(point) < 0.35;
    };
    list.dispatchEvent(new CustomEvent("paddock:box", { detail: { ...best, percent: best.percent.toFixed(1), near } }));
  });

  // --- print a page, copy a link -----------------------------------------------------------------------------------
  each("[data-print]", (button) => {
    button.hidden = false;
    button.addEventListener("click", () => print());
  });
  async function copy(button, field) {
    field.select();
    try { await navigator.clipboard.writeText(field.value); } catch { document.execCommand("copy"); }
    const label = button.textContent;
    button.textContent = button.dataset.copied;
    setTimeout(() => { button.textContent = label; }, 1600);
  }
  each("[data-copy]", (button) => {
    button.hidden = false;
    button.addEventListener("click", () => copy(button, document.getElementById(button.dataset.copy)));
  });
  // the share sheet on phones, the link elsewhere
  each("[data-share-link]", (button) => {
    button.hidden = false;
    button.addEventListener("click", async () => {
      const { shareLink: url, title } = button.dataset;
      if (navigator.share && matchMedia("(pointer: coarse)").matches) {
        try { await navigator.share({ title, url }); } catch { /* the reader closed it */ }
        return;
      }
      const field = document.createElement("input"); // outside of a secure site only a field can be copied
      field.value = url;
      button.after(field);
      await copy(button, field);
      field.remove();
      button.focus();
    });
  });

  // --- selects that act at once (a button does it without scripts) ---------------------------------------------------
  each("[data-submit-on-change]", (field) => field.addEventListener("change", () => field.form.requestSubmit()));

  // --- what a browser will not send stands open, else it could not be shown ----------------------------------------------
  document.addEventListener("invalid", (event) => {
    const closed = event.target.closest("details:not([open])");
    if (closed) closed.open = true;
  }, true);

  // --- the first error gets the focus --------------------------------------------------------------------------------
  const first = document.querySelector(".fault, .field.wrong input, .field.wrong select, .field.wrong textarea");
  if (first) first.focus();

  // --- a page begins at its heading, a form's page at its first field --------------------------------------------------
  const isShown = (field) => field.offsetParent !== null;
  function begin() {
    if (document.activeElement !== document.body || location.hash.length > 1) return;
    const form = document.querySelector("form[data-purpose]");
    const field = form && [...form.elements].find((each) => each.matches("input:not([type=hidden]), select, textarea") && !each.disabled && !each.readOnly && isShown(each));
    const heading = document.querySelector("#main h1");
    if (!field && heading && !heading.hasAttribute("tabindex")) heading.tabIndex = -1;
    (field || heading || document.getElementById("main"))?.focus({ preventScroll: true });
    // visitors from other sites reach the skip link and the header first
    const skip = document.querySelector(".skip");
    if (field || !skip || document.referrer.startsWith(location.origin)) return;
    document.addEventListener("keydown", (event) => {
      if (event.key !== "Tab" || event.shiftKey || document.activeElement !== heading) return;
      event.preventDefault();
      skip.focus();
    }, { once: true });
  }
  begin();
})();
