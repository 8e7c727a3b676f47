// Code in tables may break after dots, slashes and the like and before capitals, so that columns are no wider than its parts.
for (const code of document.querySelectorAll("article table code")) {
  const texts = document.createTreeWalker(code, NodeFilter.SHOW_TEXT);
  const nodes = [];
  while (texts.nextNode()) nodes.push(texts.currentNode);
  for (const node of nodes) {
    const parts = node.data.split(/(?<=[./_,(=|])(?=\w)|(?<=[a-z])(?=[A-Z])/);
    node.replaceWith(...parts.flatMap((part, i) => (i ? [document.createElement("wbr"), part] : [part])));
  }
}
// Cells of a few numbers are not broken, where there are few columns.
for (const cell of document.querySelectorAll("article td")) {
  if (cell.parentElement.children.length <= 6 && /^\d.{0,13}$/.test(cell.textContent.trim())) cell.style.whiteSpace = "nowrap";
}
