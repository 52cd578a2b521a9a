/* Charts: the selects show one of many, the legend brings one line forward. */

function choose(root) {
  const wanted = parts(root, "choose").map(select => select.value).join(" ");
  for (const one of root.querySelectorAll("[data-choice]")) one.hidden = one.dataset.choice !== wanted;
}

function bringForward(chart, button) {
  const pressed = button || chart.querySelector('button[aria-pressed="true"]');
  chart.classList.toggle("picked", Boolean(pressed));
  for (const line of chart.querySelectorAll("g.line")) {
    line.classList.toggle("ahead", Boolean(pressed) && line.dataset.line === pressed.dataset.line);
  }
}

function press(chart, button) {
  const was = button.getAttribute("aria-pressed") === "true";
  for (const other of chart.querySelectorAll("button[data-line]")) other.setAttribute("aria-pressed", "false");
  button.setAttribute("aria-pressed", String(!was));
  bringForward(chart, was ? null : button);
}

for (const root of parts(document, "chooser")) {
  root.addEventListener("change", () => choose(root));
  choose(root);
}
for (const chart of document.querySelectorAll(".chart")) {
  for (const button of chart.querySelectorAll("button[data-line]")) {
    for (const event of ["mouseenter", "focus"]) button.addEventListener(event, () => bringForward(chart, button));
    for (const event of ["mouseleave", "blur"]) button.addEventListener(event, () => bringForward(chart, null));
    button.addEventListener("click", () => press(chart, button));
  }
}
