/* Tables that sort, and commands that copy. */

function order(a, b) {
  const x = Number(a), y = Number(b);
  return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b, "en", {numeric: true}) : x - y;
}

function sortBy(heading) {
  const body = heading.closest("table").tBodies[0];
  const turn = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  const value = row => {
    const cell = row.cells[heading.cellIndex];
    return "value" in cell.dataset ? cell.dataset.value : cell.textContent;
  };
  for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", turn === 1 ? "ascending" : "descending");
  const rows = [...body.rows], known = rows.filter(row => value(row) !== "");
  known.sort((a, b) => turn * order(value(a), value(b)));
  body.append(...known, ...rows.filter(row => value(row) === ""));
}

async function copy(button) {
  const code = button.previousElementSibling;
  try {
    await navigator.clipboard.writeText(code.textContent);
    button.textContent = "Copied";
  } catch (refused) {
    getSelection().selectAllChildren(code);
    button.textContent = "Selected";
  }
  setTimeout(() => { button.textContent = "Copy"; }, 2000);
}

for (const button of document.querySelectorAll(".sortable th button")) {
  button.addEventListener("click", () => sortBy(button.parentElement));
}
for (const button of parts(document, "copy")) button.addEventListener("click", () => copy(button));
