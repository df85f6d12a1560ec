// Shares one stream of server-sent events among all open pages of a browser, in a shared worker or, without one, in the
// page as window.paddockStream; pages send { of, at } and receive { is: "up" | "down" | "moved" | "said", ... },
// possibly more than once.
"use strict";

(() => {
  const SILENT_MS = 45000; // the server says something every 20 s
  const GONE_MS = 70000; // a page that says nothing for so long was closed
  const FIRST_MS = 1000;
  const MOST_MS = 30000;
  const pages = new Map(); // what tells a page: { of, heard }
  let source = null;
  let followed = new Set();
  let position = null;
  let failures = 0;
  let heard = 0;
  let isUp = false;
  let timer = 0;

  const tellAll = (message) => pages.forEach((_, tell) => tell(message));
  const wanted = () => new Set([...pages.values()].flatMap(({ of }) => of));

  function close() {
    clearTimeout(timer);
    timer = 0;
    if (source) source.close();
    source = null;
  }

  function down() {
    close();
    if (isUp || !failures) tellAll({ is: "down" });
    isUp = false;
    if (!pages.size) return;
    failures += 1;
    const pause = Math.min(MOST_MS, FIRST_MS * 2 ** (failures - 1));
    timer = setTimeout(open, pause * (0.5 + Math.random() / 2));
  }

  function open() {
    close();
    followed = wanted();
    if (!followed.size) return;
    const query = new URLSearchParams([...followed].sort().slice(0, 32).map((topic) => ["of", topic]));
    if (position !== null) query.set("last", position);
    heard = Date.now();
    const opened = new EventSource(`/stream/?${query}`);
    source = opened;
    const on = (name, work) => opened.addEventListener(name, (event) => {
      if (source !== opened) return;
      heard = Date.now();
      if (event.lastEventId) position = Number(event.lastEventId);
      work(JSON.parse(event.data));
    });
    on("hello", ({ spread }) => {
      failures = 0;
      isUp = true;
      tellAll({ is: "up", spread });
    });
    on("beat", ({ spread }) => tellAll({ is: "up", spread }));
    on("message", ({ of, at }) => tellAll({ is: "moved", of, at: at ? Math.max(...at) : null }));
    on("reload", () => tellAll({ is: "moved", of: null }));
    on("said", ({ to, data }) => tellAll({ is: "said", to, data }));
    on("gone", () => { tellAll({ is: "moved", of: null }); down(); });
    on("away", down);
    opened.onerror = () => { if (source === opened) down(); };
  }

  function follow(tell, of, at) {
    pages.set(tell, { of, heard: Date.now() });
    if (at !== null) position = position === null ? at : Math.min(position, at);
    if (isUp && of.every((topic) => followed.has(topic))) tell({ is: "up" });
    else if (source || !timer) open();
  }

  function leave(tell) {
    pages.delete(tell);
    if (!wanted().size) {
      close();
      isUp = false;
    }
  }

  setInterval(() => {
    const now = Date.now();
    pages.forEach((page, tell) => { if (now - page.heard > GONE_MS) leave(tell); });
    if (source && now - heard > SILENT_MS) down();
  }, 5000);

  const take = (tell, { is, of, at }) => {
    if (is === "follow") follow(tell, of, at);
    else if (is === "leave") leave(tell);
    else if (pages.has(tell)) pages.get(tell).heard = Date.now();
  };

  if (typeof SharedWorkerGlobalScope !== "undefined") {
    self.onconnect = ({ ports: [port] }) => {
      const tell = (message) => port.postMessage(message);
      port.onmessage = ({ data }) => take(tell, data);
    };
  } else {
    window.paddockStream = take;
  }
})();
