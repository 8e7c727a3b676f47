// Sentences: those that pass, those that stay while something is wrong, and the one that takes the place of the page.

import { byId, make } from "./format.js";

const TIME = { info: 6000, warning: 12000, error: 12000, repair: 12000 };

export class Notices {
  show(kind, sentence) {
    if (!sentence) return;
    const box = byId("notices");
    for (const old of box.children) if (old.firstChild.textContent === sentence) old.remove();
    const close = make("button", { type: "button", className: "plain", ariaLabel: "Close" }, "×");
    const notice = make("div", { className: `notice ${kind}` }, make("span", {}, sentence), close);
    const go = () => notice.remove();
    close.addEventListener("click", go);
    box.append(notice);
    while (box.children.length > 4) box.firstChild.remove();
    if (TIME[kind]) setTimeout(go, TIME[kind]);
  }

  // Over the picture, as long as it is true; empty: all is well.
  banner(sentence) {
    const box = byId("banner");
    box.hidden = !sentence;
    box.textContent = sentence;
  }

  // Instead of the page: nothing can be done but what it says.
  failure(title, sentence) {
    const box = byId("failure");
    box.hidden = false;
    box.replaceChildren(make("h2", {}, title), make("p", {}, sentence));
  }
}

// A sentence over the picture for states in which the mesh cannot be worked on.
export function stateBanner({ state, connection }) {
  if (connection.kind === "lost") return connection.sentence;
  const words = {
    LOST: "The engine ended unexpectedly. It is being started again …",
    RESTORING: "The engine is back and takes up the last settled shape …",
    FAILED: "The engine could not be started again. Save the last settled shape as a session, then open it anew.",
  };
  return words[state.state] ?? "";
}
