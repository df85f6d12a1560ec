// Stores a timekeeper's sessions, laps and guests in the browser, and writes each change to disk first, so that a
// crash, an empty battery or a lost network loses nothing.
"use strict";

window.TimingStore = class {
  static async open(slug) {
    const request = indexedDB.open("paddock-timing", 1);
    request.onupgradeneeded = () => {
      request.result.createObjectStore("sessions", { keyPath: "id" }).createIndex("race", "race");
      request.result.createObjectStore("guests", { keyPath: "id" }).createIndex("race", "race");
    };
    const database = await this.done(request);
    // asked for so that a browser short of space does not clear it; a refusal changes nothing
    if (navigator.storage?.persist) navigator.storage.persist().catch(() => {});
    return new this(database, slug);
  }

  static done(request) {
    return new Promise((resolve, reject) => {
      request.onsuccess = () => resolve(request.result);
      request.onerror = () => reject(request.error);
    });
  }

  constructor(database, slug) {
    this.database = database;
    this.slug = slug;
  }

  all(name) {
    const rows = this.database.transaction(name).objectStore(name).index("race").getAll(this.slug);
    return this.constructor.done(rows);
  }

  // resolves once the row is written through to the disk
  put(name, row) {
    return new Promise((resolve, reject) => {
      const change = this.database.transaction(name, "readwrite", { durability: "strict" });
      change.oncomplete = resolve;
      change.onerror = change.onabort = () => reject(change.error);
      change.objectStore(name).put(structuredClone({ ...row, race: this.slug }));
    });
  }

  // random ids also where the page is not served securely, which is where crypto.randomUUID is missing
  static id() {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    bytes[6] = (bytes[6] & 0x0f) | 0x40;
    bytes[8] = (bytes[8] & 0x3f) | 0x80;
    const hex = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    return hex.replace(/^(.{8})(.{4})(.{4})(.{4})(.{12})$/, "$1-$2-$3-$4-$5");
  }
};
