// A button on every listing that copies it: without the prompts and the output of Python sessions and shells.
"use strict";

function listingText(pre) {
  const lines = pre.textContent.replace(/\n$/, "").split("\n");
  if (!lines[0].startsWith(">>> ")) return lines.join("\n");
  return lines.filter((line) => /^(>>>|\.\.\.)( |$)/.test(line)).map((line) => line.slice(4)).join("\n");
}

async function copyText(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const area = document.body.appendChild(document.createElement("textarea")); // pages that are opened as files
  area.value = text;
  area.select();
  const copied = document.execCommand("copy");
  area.remove();
  if (!copied) throw new Error("not copied");
}

document.addEventListener("DOMContentLoaded", () => {
  for (const pre of document.querySelectorAll("div.highlight > pre")) {
    const button = document.createElement("button");
    Object.assign(button, { className: "copy-listing", type: "button", textContent: "Copy", title: "Copy this listing" });
    button.addEventListener("click", async () => {
      try {
        await copyText(listingText(pre));
        button.textContent = "Copied";
      } catch {
        button.textContent = "Failed";
      }
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    });
    pre.parentElement.append(button);
  }
});
