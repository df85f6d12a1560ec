// The editor of a reward function: CodeMirror over the form's textarea, with examples, reset and the server's check
// marked in the code; the form works without it.
"use strict";

(() => {
  const CM = window.CodeMirror;

  function theme() {
    const { EditorView, HighlightStyle, tags } = CM;
    const look = EditorView.theme({
      "&": { color: "var(--text)", backgroundColor: "var(--field)", fontSize: "13.5px" },
      "&.cm-focused": { outline: "2px solid var(--accent)", outlineOffset: "1px" },
      ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.55", minHeight: "300px", maxHeight: "70vh" },
      ".cm-content": { caretColor: "var(--text)", padding: "8px 0" },
      ".cm-gutters": { backgroundColor: "var(--field)", color: "var(--muted)", border: "0" },
      ".cm-activeLine": { backgroundColor: "color-mix(in srgb, var(--raised) 70%, transparent)" },
      ".cm-activeLineGutter": { backgroundColor: "var(--raised)", color: "var(--text)" },
      ".cm-cursor": { borderLeftColor: "var(--text)" },
      "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground":
        { backgroundColor: "color-mix(in srgb, var(--rival) 30%, transparent)" },
      ".cm-tooltip": { backgroundColor: "var(--surface)", color: "var(--text)", border: "1px solid var(--line-strong)",
        maxWidth: "min(46ch, 80vw)", font: "14px/1.4 var(--font)" },
      ".cm-diagnostic-error": { borderLeftColor: "var(--bad)" },
      ".cm-diagnostic-warning": { borderLeftColor: "var(--slow-fill)" },
      ".cm-lintRange-warning": { backgroundImage: "none", borderBottom: "2px dotted var(--slow-fill)" },
      ".cm-lintRange-error": { backgroundImage: "none", borderBottom: "2px solid var(--bad)" },
    });
    const colours = HighlightStyle.define([
      { tag: [tags.keyword, tags.operatorKeyword, tags.controlKeyword], color: "var(--accent-strong)" },
      { tag: [tags.string, tags.special(tags.string)], color: "var(--good)" },
      { tag: [tags.number, tags.bool, tags.null], color: "var(--best)" },
      { tag: tags.comment, color: "var(--muted)", fontStyle: "italic" },
      { tag: [tags.function(tags.variableName), tags.function(tags.definition(tags.variableName))], color: "var(--rival)" },
    ]);
    return [look, CM.syntaxHighlighting(colours)];
  }

  // Left to itself, a browser that joins the lines of a selection writes styles, which the content policy blocks.
  function typeOver(event, view) {
    const { state } = view;
    const { from, to, empty } = state.selection.main;
    if (event.inputType !== "insertText" || event.data === null || empty || event.isComposing) return false;
    event.preventDefault();
    const insert = () => state.update(state.replaceSelection(event.data), { userEvent: "input.type", scrollIntoView: true });
    const taken = state.facet(CM.EditorView.inputHandler).some((take) => take(view, from, to, event.data, insert));
    if (!taken) view.dispatch(insert());
    return true;
  }

  function editorOver(area, label) {
    const host = document.createElement("div");
    host.className = "editor-host";
    area.before(host);
    const root = host.attachShadow({ mode: "open" });
    const view = new CM.EditorView({
      root,
      parent: root,
      state: CM.EditorState.create({
        doc: area.value.replace(/\r\n/g, "\n"),
        extensions: [
          CM.lineNumbers(), CM.highlightActiveLine(), CM.highlightActiveLineGutter(), CM.drawSelection(), CM.history(),
          CM.highlightSpecialChars(), CM.bracketMatching(), CM.closeBrackets(), CM.indentOnInput(),
          CM.indentUnit.of("    "), CM.EditorState.tabSize.of(4), CM.python(), CM.lintGutter(), ...theme(),
          // Escape, then Tab, leaves the editor by keyboard
          CM.keymap.of([...CM.closeBracketsKeymap, ...CM.defaultKeymap, ...CM.historyKeymap, CM.indentWithTab]),
          CM.EditorView.contentAttributes.of({ "aria-label": label, spellcheck: "false", tabindex: "0" }),
          CM.EditorView.domEventHandlers({ beforeinput: typeOver }),
          CM.EditorView.updateListener.of((update) => {
            if (!update.docChanged) return;
            area.value = update.state.doc.toString();
            area.dispatchEvent(new Event("input", { bubbles: true }));
          }),
        ],
      }),
    });
    area.hidden = true;
    // the way from the list of what is wrong: a field that is hidden cannot be gone to
    document.addEventListener("click", (event) => {
      if (!event.target.closest(`a[href="#${area.id}"]`)) return;
      event.preventDefault();
      host.scrollIntoView({ block: "center" });
      view.focus();
    });
    area.required = false;
    area.form.addEventListener("reset", () => setTimeout(() => fill(view, area.value)));
    return view;
  }

  const fill = (view, text) => view.dispatch({ changes: { from: 0, to: view.state.doc.length, insert: text } });

  function mark(view, problems, warnings = []) {
    const { doc } = view.state;
    const found = [...problems, ...warnings].filter((each) => each.line).map((each) => {
      const line = doc.line(Math.min(Math.max(1, each.line), doc.lines));
      const from = line.from + (line.text.length - line.text.trimStart().length);
      const severity = warnings.includes(each) ? "warning" : "error";
      return { from: Math.min(from, line.to), to: line.to, severity, message: each.message };
    });
    view.dispatch(CM.setDiagnostics(view.state, found.sort((a, b) => a.from - b.from)));
  }

  function element(tag, text, className) {
    const made = document.createElement(tag);
    if (text !== undefined) made.textContent = text;
    if (className) made.className = className;
    return made;
  }

  function listed(tag, className, problems, view) {
    const list = element(tag, undefined, className);
    for (const problem of problems) {
      const row = element("li");
      let words = problem.message;
      if (problem.line) {
        const jump = element("button", words, "link");
        jump.type = "button";
        jump.addEventListener("click", () => {
          const line = view.state.doc.line(Math.min(problem.line, view.state.doc.lines));
          view.dispatch({ selection: { anchor: line.from }, scrollIntoView: true });
          view.focus();
        });
        words = jump;
      }
      row.append(words);
      list.append(row);
    }
    return list;
  }

  function tell(box, report, itWorks, view) {
    const works = element("p", itWorks, "good");
    const parts = [report.problems.length ? listed("ol", "problems", report.problems, view) : works];
    if (report.warnings.length) parts.push(listed("ul", "warnings", report.warnings, view));
    if (report.rewards.length) {
      const states = element("dl", undefined, "state-rewards");
      for (const [state, value] of report.rewards) {
        const pair = element("div");
        pair.append(element("dt", state), element("dd", String(Math.round(value * 1e4) / 1e4), "num"));
        states.append(pair);
      }
      parts.push(states);
    }
    if (report.printed) parts.push(element("pre", report.printed));
    box.replaceChildren(...parts);
  }

  function start(root) {
    const area = root.querySelector("textarea");
    const box = root.querySelector("[data-report]");
    const first = area.value.replace(/\r\n/g, "\n");
    const view = editorOver(area, root.dataset.label);
    root.editor = { text: () => view.state.doc.toString(), fill: (text) => fill(view, text) };
    const clear = () => { box.replaceChildren(); mark(view, []); };

    const examples = root.querySelector("[data-examples]");
    let taken = first;
    examples.hidden = false;
    examples.addEventListener("change", () => {
      const chosen = root.querySelector(`template[data-example="${CSS.escape(examples.value)}"]`);
      if (!chosen) return;
      taken = chosen.content.textContent;
      fill(view, taken);
      clear();
      box.replaceChildren(element("p", chosen.dataset.about, "muted"));
      examples.value = "";
    });
    const reset = root.querySelector("[data-reset]");
    reset.hidden = false;
    reset.addEventListener("click", () => { fill(view, taken); clear(); });

    // what the wizard's form and the laboratory's have of it
    const FIELDS = ["track", "direction", "race_type", "discount_factor", "csrfmiddlewaretoken"];
    const sent = () => {
      const form = new FormData(area.form);
      const body = new URLSearchParams({ reward_code: area.value });
      FIELDS.filter((name) => form.has(name)).forEach((name) => body.set(name, form.get(name)));
      return body;
    };

    function onClick(button, busy, address, show) {
      button.addEventListener("click", async (event) => {
        event.preventDefault();
        const idle = button.textContent;
        button.disabled = true;
        button.textContent = busy;
        try {
          const answer = await fetch(address, { method: "POST", body: sent(), headers: { Accept: "application/json" } });
          const report = await answer.json();
          show(report);
          mark(view, report.problems, report.warnings);
        } catch {
          box.replaceChildren(element("p", root.dataset.failed, "bad"));
        }
        button.disabled = false;
        button.textContent = idle;
      });
    }
    const check = root.querySelector("[data-check]");
    onClick(check, root.dataset.busy, root.dataset.validate, (report) => tell(box, report, root.dataset.ok, view));
    onClick(root.querySelector("[data-ask]"), root.dataset.driving, root.dataset.audit, (report) => {
      box.replaceChildren(...new DOMParser().parseFromString(report.html, "text/html").body.childNodes);
    });
    root.querySelectorAll("[data-report] > .problems").forEach(() => check.click());
  }

  if (CM) document.querySelectorAll("[data-reward-editor]").forEach(start);
})();
