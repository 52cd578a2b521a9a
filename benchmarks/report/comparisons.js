/* "Which of two?": looks up what was computed when the report was written. */

const VERDICTS = ["no difference told", "A is better", "B is better", "too few seeds to tell"];

/* Entry of pairs a and b, the second less the first; they are stored once, the lower index first. */
function entryOf(all, a, b, scenario, metric) {
  const [low, high] = a < b ? [a, b] : [b, a];
  const pair = low * all.pairs - low * (low + 1) / 2 + high - low - 1;
  const entry = all.entries[(pair * all.scenarios.length + scenario) * 2 + metric];
  if (!entry || a < b) return entry;
  const [mean, from, to, seeds, verdict] = entry;
  const turned = value => value === null ? null : -value;
  return [turned(mean), turned(to), turned(from), seeds, [0, 2, 1, 3][verdict]];
}

function comparisonCells(entry) {
  if (!entry || entry[0] === null) return [make("td", {}, "–"), make("td", {}, "not known of both")];
  const [mean, low, high, seeds, verdict] = entry;
  const ends = low === null ? "" : ` [${fixed(low / 1000)}, ${fixed(high / 1000)}]`;
  const sign = mean > 0 ? "+" : "";
  const cell = make("td", {}, make("b", {}, sign + fixed(mean / 1000)), make("small", {}, ends));
  const words = VERDICTS[verdict] + (verdict === 3 ? ` (${seeds})` : "");
  return [cell, make("td", {class: `verdict v${verdict}`}, words)];
}

function compare(root, all) {
  const [a, b] = ["first", "second"].map(role => Number(part(root, role).value));
  const rows = all.scenarios.map((name, scenario) => {
    const cells = a === b ? [make("td", {colspan: 4}, "choose two different pairs")]
      : [0, 1].flatMap(metric => comparisonCells(entryOf(all, a, b, scenario, metric)));
    return make("tr", {}, make("th", {scope: "row"}, name), ...cells);
  });
  root.querySelector("tbody").replaceChildren(...rows);
}

for (const root of parts(document, "comparison")) {
  const all = data(root, "comparisons");
  root.addEventListener("change", () => compare(root, all));
  compare(root, all);
}
