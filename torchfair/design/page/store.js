// What the page knows, and who wants to hear when it changes.

export class Store {
  constructor(values) {
    Object.assign(this, values);
    this.listeners = [];
    this.changed = new Set();
  }

  // Listeners are called once, after all that changes now, however many values that are.
  put(values) {
    Object.assign(this, values);
    if (this.changed.size === 0) queueMicrotask(() => this.tell());
    for (const name of Object.keys(values)) this.changed.add(name);
  }

  tell() {
    const changed = new Set(this.changed);
    this.changed.clear();
    for (const { names, act } of this.listeners) if (names.some((name) => changed.has(name))) act(this);
  }

  // names: of values, with spaces between
  on(names, act) {
    this.listeners.push({ names: names.split(" "), act });
  }
}
